"""Learning to chain skills: T-STAR and its baselines on TorchRL."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tstar_rl.furniture_env import FurnitureEnv

__version__ = "0.1.0"
__all__ = ["FurnitureEnv", "__version__"]


def __getattr__(name: str) -> Any:
    """Imports the environment (and with it the simulator) only when it is asked for."""
    if name == "FurnitureEnv":
        from tstar_rl.furniture_env import FurnitureEnv

        return FurnitureEnv
    raise AttributeError(f"module 'tstar_rl' has no attribute {name!r}; it has {', '.join(__all__)}")
