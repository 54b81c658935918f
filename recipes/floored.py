"""A chain of trained skills with a higher floor under their normalisers' deviations. Nothing is trained.

    python recipes/floored.py task=table_lack scale=narrow floor=0.02 seed=0
    python recipes/evaluate.py system=floored scale=narrow seed=0

of skills of that scale, in folders of their own (docs/usage.md, "Step by step", has such commands).

A skill whose inputs hardly varied in training takes a small change for a large one. This control shows how much of what
a chaining method mends is only that. Policies and value networks are left as they are.
"""

from omegaconf import DictConfig

import tstar_rl as rl


@rl.recipe("floored", floor=float, from_checkpoint=str)
def main(config: DictConfig) -> None:
    """Raises the floor of every skill and saves the chain; logs how many inputs stood below it.

    Raises:
        InvalidValueError: if none did.
    """
    skills = rl.load_skills(config, checkpoint=config.from_checkpoint)
    raised = [skill.normalizer.raise_to(config.floor) for skill in skills]
    if not any(raised):
        raise rl.InvalidValueError(
            f"no input stands below floor={config.floor}: the chain would be the skills as they are; give a higher "
            "floor=..."
        )
    run = rl.chain_run(config, len(skills))
    run.start()
    for index, inputs in enumerate(raised):
        run.log(0, skill=index, raised_inputs=inputs)
    rl.save_chain(skills, run.work / "last", **run.origin, env_steps=0)
    run.finish()


if __name__ == "__main__":
    main()
