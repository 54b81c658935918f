"""The same config gives the same figures, to the bit, as when the reference tables were written.

A commit that is to change figures writes them anew and says so; one that moves code must not. To write them:
`python tests/recipes/test_reference_figures.py`.
"""

import runpy
from pathlib import Path

import pytest
import torch
from hydra import compose, initialize_config_dir

from tstar_rl.config.load import CONFIGS

ROOT = Path(__file__).resolve().parents[2]
REFERENCE = ROOT / "tests" / "data" / "reference"
SMALL = [
    "scale=quick",
    "progress_bar=false",
    "training.num_envs=32",
    "training.horizon=96",
    "training.total_steps=6144",
    "training.checkpoint_every=6144",
    "ppo.minibatch=512",
    "ppo.critic_warmup=0",
    "chain.steps_per_turn=6144",
    "chain.trial_episodes=16",
    "chain.links=2",
]


def run(folder: Path, recipe: str, *values: str) -> None:
    """Runs a recipe in this process, as its command would."""
    places = [f"{place}_dir={folder / place}" for place in ("results", "runs", "demonstrations")]
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        config = compose(f"recipe/{recipe}", [*SMALL, *places, *values])
    threads = torch.get_num_threads()
    runpy.run_path(str(ROOT / "recipes" / f"{recipe}.py"))["main"].__wrapped__(config)
    torch.set_num_threads(threads)


def make_skill(folder: Path, subtask: int) -> str:
    """Demonstrations and a skill; returns the table of its training."""
    run(folder, "make_demonstrations", f"subtask={subtask}", "kinds=[noisy]")
    run(folder, "gail_ppo", f"subtask={subtask}")
    return (folder / f"results/table_lack/gail_ppo/seed0/subtask{subtask}/metrics.csv").read_text()


def make_chain(folder: Path, recipe: str, *values: str) -> str:
    """The table of a chain of two skills, which lie in `folder`."""
    run(folder, recipe, *values)
    return (folder / f"results/table_lack/{recipe}/seed0/metrics.csv").read_text()


CHAINS = {"tstar": (), "policy_sequencing": ("bonus=0.4",)}


def test_a_skill(tmp_path):
    assert make_skill(tmp_path, 0) == (REFERENCE / "skill.csv").read_text()


@pytest.mark.slow
def test_chains(tmp_path):
    for subtask in range(2):
        make_skill(tmp_path, subtask)
    for recipe, values in CHAINS.items():
        assert make_chain(tmp_path, recipe, *values) == (REFERENCE / f"{recipe}.csv").read_text(), recipe


if __name__ == "__main__":
    import tempfile

    REFERENCE.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        tables = [make_skill(Path(name), subtask) for subtask in range(2)]
        (REFERENCE / "skill.csv").write_text(tables[0])
        for recipe, values in CHAINS.items():
            (REFERENCE / f"{recipe}.csv").write_text(make_chain(Path(name), recipe, *values))
