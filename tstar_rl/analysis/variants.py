"""Which variants an ablation compares, from `configs/ablation/<name>.yaml`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from tstar_rl.checks import InvalidValueError, MissingFileError
from tstar_rl.config.check import check
from tstar_rl.runs.run_folder import UNTRAINED, check_says_if_trained

__all__ = ["FOLDER", "SKILLS", "Ablation", "Variant", "names", "parse", "read"]

CONFIGS = Path(__file__).resolve().parents[2] / "configs" / "ablation"
FOLDER = "ablations"
SKILLS = f"{FOLDER}/skills"
"""The system under which the skills lie that every variant starts from."""


@dataclass(frozen=True)
class Variant:
    """One way of fine-tuning the same skills."""

    ablation: str
    name: str
    system: str
    """The recipe; no_finetuning has nothing to train."""
    overrides: tuple[str, ...] = ()
    """Hydra overrides, of training and of evaluation."""
    bonus_of: str | None = None
    """Pays as `bonus` what d_omega paid for a success on average in this other variant."""
    against: str | None = None
    """The variant that its result is compared with; None: the ablation's reference."""

    @property
    def place(self) -> str:
        """The system under which it lies: results/<task>/<place>/seed<k>."""
        return f"{FOLDER}/{self.ablation}/{self.name}"

    @property
    def trains(self) -> bool:
        return self.system != UNTRAINED

    def first(self) -> "Variant":
        """The first variant of any ablation that runs the same: that one is run, and the others get its tables."""
        same = [each for name in names() for each in read(name).variants if each._run() == self._run()]
        return same[0]

    def source(self) -> "Variant | None":
        """The variant that `bonus_of` means."""
        return None if self.bonus_of is None else read(self.ablation).variant(self.bonus_of)

    def _run(self) -> tuple:
        source = self.source()
        return self.system, tuple(sorted(self.overrides)), source and source._run()


@dataclass(frozen=True)
class Ablation:
    """Variants beside each other, of which one is the reference that the others are compared with."""

    name: str
    reference: str
    variants: tuple[Variant, ...]

    def variant(self, name: str) -> Variant:
        """The variant of that name.

        Raises:
            ValueError: if there is none.
        """
        for variant in self.variants:
            if variant.name == name:
                return variant
        known = ", ".join(variant.name for variant in self.variants)
        raise InvalidValueError(f"ablation {self.name} has no variant {name!r}; it has {known}")


def names() -> list[str]:
    """The names of all ablations.

    Raises:
        MissingFileError: without a clone, where no file names any.
    """
    if not CONFIGS.is_dir():
        raise MissingFileError(
            f"ablations need a clone, installed with pip install -e: there is no {CONFIGS}"
        )
    return sorted(path.stem for path in CONFIGS.glob("*.yaml"))


def read(name: str) -> Ablation:
    """The ablation in `configs/ablation/<name>.yaml`.

    Raises:
        ValueError: for an unknown name, and in the file for a field that is not known or missing or of another type, a
            variant that is named and not there, or one whose name says that it is trained or not where it is otherwise.
    """
    path = CONFIGS / f"{name}.yaml"
    if not path.is_file():
        raise InvalidValueError(f"there is no ablation {name!r} in {CONFIGS}; there are {', '.join(names())}")
    return parse(name, yaml.safe_load(path.read_text()))


def parse(name: str, values: dict[str, Any]) -> Ablation:
    """An ablation from plain values; see `read`."""
    where = f"ablation {name}"
    check({**values, "name": name}, Ablation, where, {"variants": tuple[dict[str, Any], ...]})
    fields = ("name", "system", "overrides", "bonus_of", "against")
    for one in values["variants"]:
        unknown = [str(field) for field in one if field not in fields]
        if unknown:
            raise InvalidValueError(
                f"{where}: a variant has no {', '.join(unknown)}; it has {', '.join(fields)}"
            )
        check({**one, "ablation": name}, Variant, f"{where}: a variant")
    variants = tuple(
        Variant(name, **{**one, "overrides": tuple(one.get("overrides", ()))}) for one in values["variants"]
    )
    found = [variant.name for variant in variants]
    if len(set(found)) < len(found):
        raise InvalidValueError(
            f"ablation {name}: two variants have the same name; it has {', '.join(found)}"
        )
    for variant in variants:
        check_says_if_trained(where, variant.name, variant.system)
    ablation = Ablation(name, values["reference"], variants)
    named = [other for variant in variants for other in (variant.bonus_of, variant.against) if other]
    for other in (ablation.reference, *named):
        ablation.variant(other)
    for variant in variants:
        if variant.bonus_of and ablation.variant(variant.bonus_of).bonus_of:
            raise InvalidValueError(
                f"{where}: {variant.name} has the bonus of {variant.bonus_of}, which is paid another's itself"
            )
    return ablation
