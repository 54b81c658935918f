"""A Ray cluster: one that is there already, or one of this machine's own."""

import math
import os
import threading
from dataclasses import dataclass
from typing import Any

from tstar_rl.checks import import_extra

__all__ = ["ClusterSettings", "connect", "resources"]

RETRIES = 5
"""Times that a worker, or a recipe's process, is replaced before its death is the run's."""
_connecting = threading.Lock()  # lanes side by side begin at the same time


@dataclass(frozen=True)
class ClusterSettings:
    """Where the cluster is, and what one worker or one recipe takes of it."""

    address: str | None = None
    """None: the environment's RAY_ADDRESS, or without it a cluster of this machine's own, gone with the process."""
    cpus: float = 1
    gpus: float = 0


def connect(settings: ClusterSettings, workers: int) -> Any:
    """The `ray` module, connected; a cluster of this machine's own has room for `workers`.

    Raises:
        MissingExtraError: if Ray is not installed, with the command that does it.
    """
    ray = import_extra("ray", "ray", "launch=ray or collection.backend=ray")
    with _connecting:
        if not ray.is_initialized():
            address = settings.address or os.environ.get("RAY_ADDRESS")
            cpus = max(os.cpu_count() or 1, math.ceil(workers * settings.cpus))
            own: dict[str, Any] = {} if address else {"num_cpus": cpus, "include_dashboard": False}
            ray.init(address=address, logging_level="WARNING", **own)
    return ray


def resources(settings: ClusterSettings) -> dict[str, float]:
    """What Ray keeps free for one worker or one recipe."""
    return {"num_cpus": settings.cpus, "num_gpus": settings.gpus}
