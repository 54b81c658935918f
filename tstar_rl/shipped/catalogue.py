"""Which trained chains there are, and each by its name.

tstar_rl.pretrained()                                     # {"table_lack": ["tstar", "narrow_failing", ...]}
policy = tstar_rl.load_pretrained("table_lack")           # the first of them
"""

from pathlib import Path

from tstar_rl.checks import InvalidValueError, did_you_mean
from tstar_rl.runs.checkpoint import is_checkpoint
from tstar_rl.shipped.chain import ShippedChain, load_shipped

__all__ = ["CHAINS", "DEFAULT", "find_pretrained", "load_pretrained", "pretrained"]

CHAINS = Path(__file__).parent / "chains"
"""The chains of the package lie here, at <task>/<variant>."""
DEFAULT = "tstar"
"""The variant that is meant where none is named."""


def pretrained(*, folder: str | Path = CHAINS) -> dict[str, list[str]]:
    """The variants of each task that has trained chains, the default first.

    Args:
        folder: where they lie, at <task>/<variant>; by default those of the package.
    """
    found: dict[str, list[str]] = {}
    for path in sorted(Path(folder).glob("*/*"), key=lambda path: (path.name != DEFAULT, path.name)):
        if is_checkpoint(path):
            found.setdefault(path.parent.name, []).append(path.name)
    return dict(sorted(found.items()))


def load_pretrained(task: str, variant: str | None = None, *, folder: str | Path = CHAINS) -> ShippedChain:
    """A trained chain: a map from "observation", "subtask" to "action" for `FurnitureEnv` of the whole task.

    policy = load_pretrained("table_lack")
    env = FurnitureEnv("table_lack", 16, **policy.env_settings)

    It samples as TorchRL's `set_exploration_type` says.

    Args:
        task: furniture, or "<task>/<variant>".
        variant: which of its chains: see `pretrained`; the default is "tstar".
        folder: where they lie, at <task>/<variant>; by default those of the package.

    Raises:
        InvalidValueError: if there is no such chain; it lists those that there are. A ValueError.
        DamagedCheckpointError: if a file is not as it was written; it names the file. A ValueError.
    """
    place = find_pretrained(task, variant, folder=folder)
    return load_shipped(place, task=place.parent.name)


def find_pretrained(task: str, variant: str | None = None, *, folder: str | Path = CHAINS) -> Path:
    """The folder <task>/<variant> of a trained chain; takes and raises what `load_pretrained` does of unknown names."""
    if variant is None:
        task, _, variant = task.partition("/")
    variant, there = variant or DEFAULT, pretrained(folder=folder)
    for what, name, valid in (
        ("task with trained chains", task, there),
        (f"trained chain of {task}", variant, there.get(task, ())),
    ):
        if name not in valid:
            there_are = ", ".join(valid) or f"none in {folder}"
            raise InvalidValueError(
                f"unknown {what}: {name!r}; there are {there_are}{did_you_mean(name, valid)}"
            )
    return Path(folder) / task / variant
