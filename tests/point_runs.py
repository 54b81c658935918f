"""Chaining recipes run on the point chain, in this process."""

import runpy
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import pandas as pd
import pytest
import torch
from hydra import compose, initialize_config_dir
from point_chain import SUBTASKS, PointChain, make_skills
from recipe_runs import ROOT

from tstar_rl.chaining.skill import Skill
from tstar_rl.config import build, chain
from tstar_rl.config.values import CONFIGS
from tstar_rl.env import furniture_env
from tstar_rl.runs import checkpoint
from tstar_rl.runs.run_folder import FINISHED

SMALL = [
    "progress_bar=false",
    "training.num_envs=64",
    "training.horizon=8",
    "chain.steps_per_turn=1024",
    "chain.rounds=1",
    "chain.trial_episodes=64",
    "chain.seed_episodes=64",
    "++chain.ppo.critic_warmup=0",
    "++ppo.rate_warmup=0",
    "ppo.learning_rate=1.0e-3",
    "ppo.minibatch=128",
    "++ppo.kl_stop=1.0e+9",
    "exploration={arm: [0.3, 0.3], hand: [0.3, 0.3]}",
    "d_omega.steps=64",
    "d_omega.learning_rate=1.0e-3",
    "d_omega.gradient_penalty=0.1",
]
"""Two rollouts of 512 steps a turn; an episode takes three or four steps."""
SIZES = [
    "networks.hidden=[16]",
    "networks.value_hidden=null",
    "networks.discriminator_hidden=[16]",
    "networks.action_std=0.3",
    "networks.hand_std=0.3",
    "networks.std=fixed",
    "networks.features=false",
]
"""Values of a config, otherwise the laptop scale's, that has the networks of point_chain.NETWORKS."""


@pytest.fixture
def point_skills(tmp_path, monkeypatch) -> list[Skill]:
    """Of a chain on the point, untrained: about half of its episodes fail at the second, which succeeds where y > 0."""
    make_skills(tmp_path)
    monkeypatch.setattr(furniture_env, "FurnitureEnv", PointChain)
    return [Skill.load(tmp_path / f"runs/table_lack/gail_ppo/seed0/subtask{k}/last") for k in range(SUBTASKS)]


@pytest.fixture
def point_chain(tmp_path, monkeypatch):
    """Runs a chaining recipe on the point; returns its table of metrics.

    The checkpoints of its turns take a third of such a run, and are written with resumable=True alone.
    """
    make_skills(tmp_path)
    observations = torch.rand(64, 72, generator=torch.Generator().manual_seed(0))
    expert = SimpleNamespace(observations=observations, actions=torch.zeros(64, 9))
    monkeypatch.setattr(furniture_env, "FurnitureEnv", PointChain)
    for module in (build, chain):
        monkeypatch.setattr(module, "load_demonstrations", lambda config, subtask: expert)

    def run(recipe: str, *values: str, resumable: bool = False, file: Path | None = None) -> pd.DataFrame:
        """With `file` that recipe runs, with the config of the one that is named."""
        places = [f"{place}_dir={tmp_path / place}" for place in ("results", "runs")]
        with initialize_config_dir(str(CONFIGS), version_base="1.3"):
            config = compose(f"recipe/{recipe}", [*SMALL, *SIZES, *places, *values])
        begun = tmp_path / f"runs/table_lack/{config.system}/seed{config.seed}"
        if begun.is_dir() and not (begun / FINISHED).is_file():
            said = "a run that was killed would begin anew: give both calls resumable=True"
            assert resumable or not config.resume, said
        with monkeypatch.context() as patch:
            if not resumable:
                patch.setattr(checkpoint, "save_step", lambda *_: None)
            runpy.run_path(str(file or ROOT / "recipes" / f"{recipe}.py"))["main"].__wrapped__(config)
        return pd.read_csv(tmp_path / f"results/table_lack/{config.system}/seed{config.seed}/metrics.csv")

    return run


class MadeWorld(NamedTuple):
    """What an environment on the point was made with."""

    num_envs: int
    subtask: int | None
    seed: int
    max_steps: int | None
    """As given: of one subtask."""


@pytest.fixture
def worlds(monkeypatch) -> list[MadeWorld]:
    """Every environment on the point, in the order in which they are made."""
    made, init = [], PointChain.__init__

    def noted(env, task, num_envs=1, subtask=None, seed=0, **settings):
        made.append(MadeWorld(num_envs, subtask, seed, settings.get("max_steps")))
        init(env, task, num_envs, subtask, seed, **settings)

    monkeypatch.setattr(PointChain, "__init__", noted)
    return made
