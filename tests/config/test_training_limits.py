"""How long an episode may last that begins in a state of a demonstration, as long as any other; and other starts."""

import pytest
import torch
from hydra import compose, initialize_config_dir
from tensordict import TensorDict

from tstar_rl.config import build
from tstar_rl.config.values import CONFIGS


@pytest.mark.parametrize(
    ("values", "limit"), [(["scale=quick", "subtask=1"], 9), (["scale=whole_quick"], 9 * 4)]
)
def test_of_a_skill_and_of_the_whole_task(values, limit, point_chain, monkeypatch, tmp_path):
    asked = []
    monkeypatch.setattr(build, "DemonstrationStarts", lambda expert, limit, steps: asked.append(limit))
    places = [f"{place}_dir={tmp_path / place}" for place in ("results", "runs")]
    starts = ("training.max_steps=9", "training.demonstration_starts=0.5")
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        config = compose("recipe/gail_ppo", [*values, *places, *starts])
    build.skill_training(config)
    assert asked == [limit]


class Late:
    """A source of starts: points in the seventh step of their episodes."""

    def sample(self, n: int, generator: torch.Generator) -> TensorDict:
        task = {"subtask": torch.zeros(n, dtype=torch.int64), "episode_step": torch.full((n,), 7)}
        return TensorDict(
            {"physics": torch.zeros(n, 4, dtype=torch.float64), "task": TensorDict(task, [n])}, [n]
        )


def test_episodes_go_on_from_starts_of_ones_own(point_chain, tmp_path):
    places = [f"{place}_dir={tmp_path / place}" for place in ("results", "runs")]
    small = ("training.max_steps=8", "training.num_envs=4", "training.horizon=3")
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        config = compose(
            "recipe/gail_ppo",
            ["scale=quick", "subtask=0", *places, *small, "training.demonstration_starts=1.0"],
        )
    rollout = build.skill_training(config, starts=Late()).collection.rollout()
    assert rollout["start_chained"].all() and rollout["next", "done"].all(), "each has a step left"
