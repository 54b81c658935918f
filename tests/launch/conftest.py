"""What tests of steps share."""

import pytest
from finished_steps import composed, places
from hydra import initialize_config_dir

from tstar_rl.config.values import CONFIGS
from tstar_rl.launch import steps


@pytest.fixture
def shared(tmp_path, monkeypatch):
    """Values that every step is given, while Hydra's configs are there."""
    monkeypatch.setattr(steps, "step_config", composed)
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        yield ["scale=quick", *places(tmp_path)]
