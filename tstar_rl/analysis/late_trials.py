"""Whether chains get worse while they are fine-tuned on: their last trial less earlier ones."""

import pandas as pd

from tstar_rl.analysis.statistics import student_half
from tstar_rl.analysis.turns import tried_turns
from tstar_rl.checks import InvalidValueError

__all__ = ["late_trials"]


def late_trials(metrics: pd.DataFrame, task: str, earlier: int) -> pd.DataFrame:
    """A line for each arm whose chains were tried more than `earlier` times.

    Args:
        metrics: of `read_metrics`.
        task: of the chains.
        earlier: the trial, counted from 1, with which the last one is compared.

    Returns:
        Index arm; columns seeds, trials (of the seed with the fewest; of the others as many count), last (progress in
        the last trial, mean over seeds), since_best and since_best_half (last less the highest of all trials before it:
        the highest of several noisy ones is too high, so this is too low), and since and since_half (last less the
        `earlier` one). The halves are those of Student's 95% interval over seeds, nan of one.

    Raises:
        InvalidValueError: if `earlier` is no number of a trial.
    """
    if not isinstance(earlier, int) or earlier < 1:
        raise InvalidValueError(f"late_trials must be the number of a trial, counted from 1, got {earlier!r}")
    lines = {}
    for arm, rows in tried_turns(metrics, task).sort_values("env_steps").groupby("recipe"):
        seeds = [seed.to_list() for _, seed in rows.groupby("seed")["trial_progress"]]
        trials = pd.DataFrame(list(zip(*seeds, strict=False))).T
        if trials.shape[1] <= earlier:
            continue
        last = trials.iloc[:, -1]
        line = {"seeds": len(trials), "trials": trials.shape[1], "last": last.mean()}
        for name, before in (
            ("since_best", trials.iloc[:, :-1].max(axis=1)),
            ("since", trials.iloc[:, earlier - 1]),
        ):
            changes = (last - before).to_numpy()
            line |= {name: changes.mean(), f"{name}_half": student_half(changes)}
        lines[str(arm)] = line
    return pd.DataFrame.from_dict(lines, orient="index").rename_axis("arm")
