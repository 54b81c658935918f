"""The gate at the end of a turn: a skill that got worse is put back."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from torchrl.envs import TransformedEnv

from tstar_rl.chaining.skill import Skill
from tstar_rl.chaining.trials import hand_over, try_out

__all__ = ["Gate", "GateSettings", "Judgement"]


@dataclass(frozen=True)
class GateSettings:
    """What is compared at the end of a turn, and when."""

    on: Literal["skill", "chain"] | None
    """What must not get worse: the skill's own success, or the progress of the whole chain. None: there is no gate."""
    margin: float
    """Loss that is accepted, in share of episodes or of progress."""
    whole_trial_every: int
    """Turns between trials of the whole chain that no gate asks for."""


@dataclass(frozen=True)
class Judgement:
    """What a turn's end has found; what was not measured is None."""

    success_before: float | None = None
    success_after: float | None = None
    accepted: bool | None = None
    progress: float | None = None
    """Of the chain that goes on."""

    def row(self) -> dict[str, float]:
        """The columns of the log."""
        columns = {
            "trial_before": self.success_before,
            "trial_after": self.success_after,
            "accepted": None if self.accepted is None else int(self.accepted),
            "trial_progress": self.progress,
        }
        return {name: value for name, value in columns.items() if value is not None}


class Gate:
    """Judges a skill after its turn, and puts it back to what it was if it got worse.

    A trial of the chain after one turn is that before the next, and is not run twice. One that is not in memory, as
    after a run was killed, is run again with the same result.

    Args:
        settings: see `GateSettings`.
        chain_progress: of the chain as it stands, from the same starts whenever it is asked.
    """

    def __init__(self, settings: GateSettings, chain_progress: Callable[[], float]) -> None:
        self.settings, self.chain_progress = settings, chain_progress
        self._progress: float | None = None

    def judge(
        self, skill: Skill, before: dict[str, Any], make_trial: Callable[[], TransformedEnv], turn: int
    ) -> Judgement:
        """Judges `skill` after turn number `turn`; the skill that goes on hands over what it reached.

        Args:
            skill: as trained.
            before: its `network_state` before the turn.
            make_trial: makes the environment of the skill's trial, each time with the same starts.
            turn: number of the turn.
        """
        found = Judgement() if self.settings.on is None else self._compare(skill, before, make_trial)
        progress = found.progress
        if progress is None and (turn + 1) % self.settings.whole_trial_every == 0:
            progress = self.chain_progress()
        self._progress = progress
        return Judgement(found.success_before, found.success_after, found.accepted, progress)

    def _compare(
        self, skill: Skill, before: dict[str, Any], make_trial: Callable[[], TransformedEnv]
    ) -> Judgement:
        whole = self.settings.on == "chain"
        success_after, last_after = try_out(skill, make_trial())
        after = self.chain_progress() if whole else success_after
        trained = skill.network_state()
        skill.load_network_state(before)
        success_before, last_before = try_out(skill, make_trial())
        was = success_before
        if whole:
            was = self.chain_progress() if self._progress is None else self._progress
        accepted = after >= was - self.settings.margin
        if accepted:
            skill.load_network_state(trained)
        hand_over(skill, last_after if accepted else last_before)
        kept = (after if accepted else was) if whole else None
        return Judgement(success_before, success_after, accepted, kept)
