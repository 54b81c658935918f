"""What this library takes of TorchRL that TorchRL does not promise: another version fails here, by name."""

import inspect

import pytest
from torchrl.collectors import Collector
from torchrl.envs import Transform
from torchrl.objectives import SACLoss


@pytest.mark.parametrize(
    ("owner", "name"),
    [
        (Transform, "_reset_env_preprocess"),
        (SACLoss, "_compute_target_v2"),
        (SACLoss, "_alpha_loss"),
        (SACLoss, "_cached_detached_qvalue_params"),
    ],
)
def test_what_is_overridden_or_called_is_there(owner, name):
    assert hasattr(owner, name), f"this version of TorchRL has no {owner.__name__}.{name}"


@pytest.mark.parametrize(("owner", "name"), [(Collector, "_carrier"), (SACLoss, "_vmap_qnetworkN0")])
def test_what_an_instance_is_asked_for_is_there(owner, name):
    source = "".join(inspect.getsource(base) for base in owner.__mro__[:-1] if "torchrl" in base.__module__)
    assert f"self.{name}" in source, f"no {owner.__name__} of this version of TorchRL has {name}"
