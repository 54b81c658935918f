"""What a check of furniture has to say."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Finding", "doubtful", "wrong"]


@dataclass(frozen=True)
class Finding:
    """One thing to look at: `where` in the file, and what about it; `wrong` where it cannot work as it is."""

    wrong: bool
    where: str
    text: str

    def __str__(self) -> str:
        return f"{'WRONG   ' if self.wrong else 'doubtful'}  {self.where}: {self.text}"


def wrong(where: str, text: str) -> Finding:
    """What cannot work as it is."""
    return Finding(True, where, text)


def doubtful(where: str, text: str) -> Finding:
    """What often goes wrong."""
    return Finding(False, where, text)
