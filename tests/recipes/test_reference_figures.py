"""The same config gives the same figures, to the bit, as when the reference tables were written.

A commit that is to change figures writes them anew and says so; one that moves code must not. To write them:
`python tests/recipes/test_reference_figures.py`.

MKL and torch choose their code by the processor that they find, and the last bits differ. So these figures come from a
process in which all three choices are made for them: see docs/decisions/0025-same-bits-elsewhere.md.
"""

import os
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
REFERENCE = ROOT / "tests" / "data" / "reference"
EVERY_PROCESSOR = {
    "MKL_CBWR": "COMPATIBLE",  # matrix products
    "MKL_VML_DEBUG_CPU_TYPE": "1",  # square roots and the like
    "ATEN_CPU_CAPABILITY": "default",  # torch's own
}
SMALL = [
    "scale=quick",
    "progress_bar=false",
    "training.num_envs=32",
    "training.horizon=96",
    "training.total_steps=6144",
    "training.checkpoint_every=6144",
    "bc.epochs=6",
    "ppo.minibatch=512",
    "ppo.critic_warmup=0",
    "chain.steps_per_turn=6144",
    "chain.trial_episodes=16",
    "chain.links=2",
]
CHAINS = {"tstar": (), "policy_sequencing": ("bonus=0.4",)}


def run(folder: Path, recipe: str, *values: str) -> None:
    """Runs a recipe in this process, as its command would."""
    from hydra import compose, initialize_config_dir

    from tstar_rl.config.values import CONFIGS

    places = [f"{place}_dir={folder / place}" for place in ("results", "runs", "demonstrations")]
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        config = compose(f"recipe/{recipe}", [*SMALL, *places, *values])
    runpy.run_path(str(ROOT / "recipes" / f"{recipe}.py"))["main"].__wrapped__(config)


def make_skill(folder: Path, subtask: int) -> str:
    """Demonstrations and a skill; returns the table of its training."""
    run(folder, "make_demonstrations", f"subtask={subtask}", "kinds=[noisy]")
    run(folder, "gail_ppo", f"subtask={subtask}")
    return (folder / f"results/table_lack/gail_ppo/seed0/subtask{subtask}/metrics.csv").read_text()


def make_tables(folder: Path, chains: bool) -> dict[str, str]:
    """The table of a skill, and with `chains` those of chains of two, by the names of their reference files."""
    tables = {"skill": make_skill(folder, 0)}
    if chains:
        make_skill(folder, 1)
    for recipe, values in CHAINS.items() if chains else ():
        run(folder, recipe, *values)
        tables[recipe] = (folder / f"results/table_lack/{recipe}/seed0/metrics.csv").read_text()
    return tables


def make_elsewhere(folder: Path, chains: bool) -> dict[str, str]:
    """`make_tables` in a process that uses only what every processor has; its tables are left in `folder`/tables."""
    command = [sys.executable, __file__, str(folder), *(["chains"] if chains else [])]
    done = subprocess.run(
        command, env=os.environ | EVERY_PROCESSOR, cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return {file.stem: file.read_text() for file in (folder / "tables").iterdir()}


def check_tables(tables: dict[str, str]) -> None:
    """Against the reference, all of them before it is said which differ."""
    differ = [name for name, table in tables.items() if table != (REFERENCE / f"{name}.csv").read_text()]
    assert not differ


def test_a_skill_makes_the_reference_table_to_the_byte(tmp_path):
    tables = make_elsewhere(tmp_path, chains=False)
    assert list(tables) == ["skill"]
    check_tables(tables)


@pytest.mark.slow
def test_chains_make_the_reference_tables_to_the_byte(tmp_path):
    tables = make_elsewhere(tmp_path, chains=True)
    assert sorted(tables) == ["policy_sequencing", "skill", "tstar"]
    check_tables(tables)


def main(folder: Path, chains: bool) -> None:
    """Leaves the tables in `folder`/tables, a CSV file each."""
    (folder / "tables").mkdir()
    for name, table in make_tables(folder, chains).items():
        (folder / "tables" / f"{name}.csv").write_text(table)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]), "chains" in sys.argv[2:])
    else:
        import tempfile

        with tempfile.TemporaryDirectory() as name:
            for stem, table in make_elsewhere(Path(name), chains=True).items():
                (REFERENCE / f"{stem}.csv").write_text(table)
