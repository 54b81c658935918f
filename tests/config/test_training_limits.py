"""How long an episode may last that begins in a state of a demonstration: as long as any other of that training."""

import pytest
from hydra import compose, initialize_config_dir

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
