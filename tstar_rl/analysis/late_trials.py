"""Whether chains get worse while they are fine-tuned on: the trial after their last round less earlier ones."""

import pandas as pd

from tstar_rl.analysis.differences import student_half
from tstar_rl.analysis.turns import tried_turns
from tstar_rl.checks import InvalidValueError

__all__ = ["late_trials"]


def late_trials(metrics: pd.DataFrame, task: str, earlier: int) -> pd.DataFrame:
    """A line for each arm with more than `earlier` rounds. Of a round only its last trial counts.

    A round after which not every seed has a trial does not count; an arm has no line where round `earlier` is one.

    Args:
        metrics: of `read_metrics`.
        task: of the chains.
        earlier: the round, counted from 1, with whose trial the last one is compared.

    Returns:
        Index arm; columns seeds, rounds (of the seed with the fewest; of the others as many count), last (progress in
        the last trial, mean over seeds), since_best and since_best_half (last less the highest trial of all rounds
        before it: the highest of several noisy ones is too high, so this is too low), and since and since_half (last
        less that of round `earlier`). The halves are those of Student's 95% interval over seeds: see `student_half`.

    Raises:
        InvalidValueError: if `earlier` is no number of a round.
    """
    if not isinstance(earlier, int) or earlier < 1:
        raise InvalidValueError(f"late_trials must be the number of a round, counted from 1, got {earlier!r}")
    lines = {}
    tried = tried_turns(metrics, task)
    if tried.empty or "round" not in tried:  # a chain of a user's own may log none
        return pd.DataFrame()
    ends = tried.sort_values("env_steps").groupby(["recipe", "seed", "round"], as_index=False).last()
    for arm, rows in ends.groupby("recipe"):
        trials = rows.pivot(index="seed", columns="round", values="trial_progress").dropna(axis=1)
        # In metrics.csv rounds are counted from 0.
        number = 1 + max(map(int, trials.columns), default=-1)
        if number <= earlier or earlier - 1 not in trials:
            continue
        last = trials[number - 1]
        line = {"seeds": len(trials), "rounds": number, "last": last.mean()}
        for name, before in (
            ("since_best", trials.drop(columns=number - 1).max(axis=1)),
            ("since", trials[earlier - 1]),
        ):
            changes = (last - before).to_numpy()
            line |= {name: changes.mean(), f"{name}_half": student_half(changes)}
        lines[str(arm)] = line
    return pd.DataFrame.from_dict(lines, orient="index").rename_axis("arm")
