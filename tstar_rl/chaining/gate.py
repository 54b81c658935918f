"""The gate at the end of a turn: what the turn changed is put back if the chain got worse."""

from collections.abc import Callable
from dataclasses import dataclass

from tstar_rl.chaining.trials import Trial
from tstar_rl.checks import check_ranges

__all__ = ["Gate", "GateSettings", "Judgement"]


@dataclass(frozen=True)
class GateSettings:
    """Whether and when the chain is tried."""

    rejects: bool
    """Whether a turn that made the chain worse is put back; False (the paper): no turn is."""
    margin: float
    """Loss of progress that is accepted."""
    trial_every: int
    """Turns between trials of the chain, where no gate asks for one after each. If there are fewer turns in all,
    none is run, and no chain is saved as the best. A trial judges the signals of the skill whose turn it follows: where
    this number and that of the skills have a factor in common, or rounds are fewer than it, some are never judged."""

    def __post_init__(self) -> None:
        check_ranges(self, finite=("margin",), count=("trial_every",))

    @property
    def every_turn(self) -> bool:
        """Whether a trial follows every turn."""
        return self.rejects or self.trial_every == 1


@dataclass(frozen=True)
class Judgement:
    """What the end of a turn has found; what was not measured is None."""

    before: Trial | None = None
    """Of the chain as it stood before the turn."""
    after: Trial | None = None
    """Of the chain as trained."""
    accepted: bool | None = None
    steps: int = 0
    """Environment steps that were spent on trials."""

    @property
    def kept(self) -> Trial | None:
        """The trial of the chain that goes on."""
        return self.before if self.accepted is False else self.after

    def row(self, skill: int) -> dict[str, float]:
        """The columns of the log after a turn of `skill`.

        trial_before and trial_after are its success from where the skill before ends, tried_progress is that of the
        chain as trained, which the gate judges, and trial_progress that of the chain that goes on.
        """
        columns: dict[str, float] = {}
        if self.accepted is not None and self.before is not None and self.after is not None:
            columns["trial_before"] = self.before.skills[skill].success
            columns["trial_after"] = self.after.skills[skill].success
            columns["accepted"] = int(self.accepted)
            columns["tried_progress"] = self.after.progress
        if self.kept is not None:
            columns["trial_progress"] = self.kept.progress
        return columns | {"trial_steps": self.steps}


class Gate:
    """Tries the chain after a turn, always from the same starts, and puts the turn back if the chain got worse.

    The last trial of the chain as it goes on is compared with that after the next turn, so it is not run twice. Nor are
    the skills before the one that was trained, which do what they did. Where there is no such trial, at first and after
    a run was killed, the chain is tried as it was before the turn.

    Args:
        settings: see `GateSettings`.
        run_trial: of the chain as it stands, always from the same starts; it is given the trial that is known, if one
            is, and the first skill that has changed since, see `trials.run_trial`.
    """

    def __init__(self, settings: GateSettings, run_trial: Callable[[Trial | None, int], Trial]) -> None:
        self.settings, self.run_trial = settings, run_trial
        self._known: Trial | None = None

    def judge(
        self,
        turn: int,
        skill: int,
        undo: Callable[[], None],
        redo: Callable[[], None],
        tried: Callable[[Trial], None] = lambda trial: None,
    ) -> Judgement:
        """Judges turn number `turn`.

        Args:
            turn: number of the turn.
            skill: that was trained in it.
            undo: puts back everything that the turn changed.
            redo: makes it as trained again, after `undo`.
            tried: is given the trial of the chain as trained, while everything is as trained.
        """
        if not self.settings.rejects:
            judgement = self._measure(turn, skill)
            if judgement.after is not None:
                tried(judgement.after)
            return judgement
        before = self._known
        if before is None:
            undo()
            before = self.run_trial(None, 0)
            redo()
        after = self.run_trial(before, skill)
        tried(after)
        # What a resumed run repeats does not count.
        steps = after.steps(skill) + (before.steps() if turn == 0 else 0)
        accepted = after.progress >= before.progress - self.settings.margin
        if not accepted:
            undo()
        self._known = after if accepted else before
        return Judgement(before, after, accepted, steps)

    def _measure(self, turn: int, skill: int) -> Judgement:
        """What is known after a turn that is not put back."""
        if (turn + 1) % self.settings.trial_every:
            return Judgement()
        first = skill if turn and self.settings.trial_every == 1 else 0
        self._known = self.run_trial(self._known, first)
        return Judgement(after=self._known, steps=self._known.steps(first))
