"""The bonus of an arm that pays every success what another arm paid on average: a number once that one is trained."""

from pathlib import Path

from tstar_rl.checks import InvalidValueError, MissingFileError
from tstar_rl.launch.side_by_side import Step
from tstar_rl.runs.csv_tables import read_table
from tstar_rl.runs.run_folder import FINISHED, made_by, run_path

__all__ = ["BONUS", "bonus_source", "mean_bonus", "with_bonus", "with_some_bonus", "without_bonus"]

BONUS = "bonus_of="
"""Stands in a step's values for a bonus that is known once another arm has been trained."""
OF_EVERY_SKILL = ("reward_env", "reward_gail")
"""Columns of a run whose next skill pays nothing."""


def bonus_source(step: Step) -> str | None:
    """The arm that decides a step's bonus; None where the step waits for none."""
    return next((value.removeprefix(BONUS) for value in step if value.startswith(BONUS)), None)


def without_bonus(step: Step) -> Step:
    """A step less a bonus that is not known yet."""
    return tuple(value for value in step if not value.startswith(BONUS))


def with_some_bonus(step: Step) -> Step:
    """A step with a number for a bonus that is not known yet, to ask what its recipe refuses."""
    return tuple("bonus=0.5" if value.startswith(BONUS) else value for value in step)


def with_bonus(
    step: Step,
    task: str,
    seed: int,
    results: str | Path,
    runs: str | Path,
    published: str | Path | None = None,
) -> Step:
    """A step in which the bonus of another arm is a number, once that arm has been trained.

    Args:
        step: recipe and values.
        task: furniture.
        seed: of both arms.
        results: where the table of that arm's training lies, if it was trained here.
        runs: where that training notes that it has finished.
        published: where its table lies, if it was trained elsewhere.

    Raises:
        MissingFileError: if there is no table of it, or the training has not finished.
    """
    values = []
    for value in step:
        if value.startswith(BONUS):
            place = (task, value.removeprefix(BONUS), seed)
            table = run_path(results, *place) / "metrics.csv"
            if not (run_path(runs, *place) / FINISHED).is_file():
                kept = None if published is None else run_path(published, *place) / "metrics.csv"
                if kept is not None and kept.is_file():
                    table = kept
                elif table.is_file():
                    raise MissingFileError(
                        f"the training of {table.parent} has not finished, and decides the bonus"
                    )
            value = f"bonus={mean_bonus(table)}"
        values.append(value)
    return tuple(values)


def mean_bonus(metrics: str | Path) -> float:
    """What d_omega paid for a success, on average over all successes, for a control that always pays as much.

    Args:
        metrics: of a run, with the columns of `rollout_metrics`: a rollout counts by its successes; none counts of
            a skill that is never paid. Where one that is has no "tsr_on_success" yet, its successes were paid 0.

    Returns:
        In [0, 1], rounded to four digits; 0 if nothing was paid.

    Raises:
        MissingFileError: if the run has not begun, with the recipe that it is of.
        InvalidValueError: if the run paid no term tsr, and one that is not of the paper.
        LogError: if the table is cut off.
    """
    if not Path(metrics).is_file():
        raise MissingFileError(f"no {metrics}{made_by(metrics)}")
    table = read_table(metrics)
    if "tsr_on_success" not in table:
        columns = [str(name) for name in table.columns]
        if own := [name for name in columns if name.startswith("reward_") and name not in OF_EVERY_SKILL]:
            raise InvalidValueError(
                f"{metrics}: bonus_of is of an arm that pays the term tsr, which TerminalStateReward and what derives "
                f"from it write; this one pays {', '.join(own)}"
            )
        return 0.0
    skills = table["skill"][table["tsr_on_success"].notna()].unique()
    paid = table[table["skill"].isin(skills) & table["success_rate"].notna()].fillna({"tsr_on_success": 0.0})
    successes = paid["episodes"] * paid["success_rate"]
    if not successes.sum():
        print(f"{metrics}: no success was paid anything, so the constant bonus of its control is 0")
        return 0.0
    mean = float((successes * paid["tsr_on_success"]).sum() / successes.sum())
    return round(min(max(mean, 0.0), 1.0), 4)
