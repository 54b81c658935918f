"""What a signal may learn of a start. This imports no torch, so that a recipe can name it before anything is loaded."""

from typing import Literal

__all__ = ["LABELS", "Label"]

Label = Literal["success", "share"]
"""What F learns of a start: whether the skill then succeeded, or the share of the rest of the chain that was done."""
LABELS: tuple[Label, ...] = ("success", "share")
"""All of them."""
