"""The command line about furniture: `python -m tstar_envs.furniture check FILE`."""

from tstar_envs.inspection.command import main

if __name__ == "__main__":
    raise SystemExit(main())
