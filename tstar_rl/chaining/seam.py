"""The seam of two skills, and the two kinds of states that a discriminator tells apart there."""

from typing import NamedTuple

from torch import Tensor

from tstar_rl.chaining.skill import Skill

__all__ = ["Seam"]


class Seam(NamedTuple):
    """Two skills, one after the other."""

    before: Skill
    after: Skill

    def states(self) -> dict[str, Tensor]:
        """What a discriminator of the seam tells apart: where the second succeeds from, and where the first ends."""
        after, before = self.after.initiation_set, self.before.termination_set
        return {"initiation": after.observations(), "termination": before.observations()}
