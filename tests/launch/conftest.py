"""What tests of steps share."""

import pytest
from finished_steps import places
from hydra import initialize_config_dir

from tstar_rl.config.values import CONFIGS


@pytest.fixture
def shared(tmp_path):
    """Values that every step is given, while Hydra's configs are there."""
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        yield ["scale=quick", *places(tmp_path)]
