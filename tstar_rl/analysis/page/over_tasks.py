"""The section of an experiment that aggregates over its tasks: a table, a figure, and what is missing."""

from collections.abc import Sequence
from pathlib import Path

from tstar_rl.analysis.experiments import Experiment, TaskScores
from tstar_rl.analysis.figures import save_figure, tasks_figure
from tstar_rl.analysis.learned import ROUNDING
from tstar_rl.analysis.over_tasks import (
    arms_with,
    lacking_seeds,
    lacking_tasks,
    skills_of_tasks,
    task_sets,
    tasks_table,
)
from tstar_rl.analysis.page.contents import FILE, Entry
from tstar_rl.analysis.page.each_task import each_task
from tstar_rl.analysis.page.markdown import (
    NOTHING,
    Paper,
    arm_label,
    arm_order,
    from_to,
    interval,
    interval_of,
    picture,
    table,
)
from tstar_rl.analysis.task_questions import answer_over_tasks, compare_over_tasks, paired_runs, sign_test
from tstar_rl.checks import InvalidValueError

__all__ = ["draw_over_tasks", "over_tasks", "short_over_tasks"]

HEADING = "over all tasks"
FIGURE = (
    "Left: every run, and below them the interquartile mean. Right: the share of runs above a progress. "
    "The axes of progress are stretched towards 1."
)
READING = """\
A run is one seed of one task. Every task has the same weight. Progress is the share of a task's subtasks, so tasks of
two and of seven subtasks can be set beside each other. The interquartile mean leaves out a quarter of the runs at
either end, whatever their task: a task on which all arms do badly may not be in it, so look at the dots too.

For the interval, seeds are drawn within their task, and episodes within their seed. Tasks are not drawn: nothing is
said of other tasks. With three seeds of each task it is too narrow ([decision 0017](decisions/0017-intervals.md)).

*Improvement* is the probability that a seed of the arm has more progress than a seed of the reference on the same
task, a tie counting half, mean over tasks; .5 is no difference. It is of the seeds that both have, not paired by seed.
The reference is {reference}.

In the table of questions, *seeds alone* is its interval if episodes are not drawn. The rule was declared with the other
interval, which is pulled towards .5 where chains are near their ceiling; where the two give different answers, both are
said. In the sign test a tie counts against the arm that is ahead.
"""


def over_tasks(experiment: Experiment, paper: Paper, entry: Entry) -> str:
    """The section, with its heading; nothing for an experiment of one task.

    Raises:
        InvalidValueError: if no arm is called as the entry's reference.
    """
    if len(experiment.tasks) < 2:
        return ""
    _check_reference(experiment, entry)
    scores, left_out = _aggregated(experiment, entry)
    said = [f"### {entry.title}: {HEADING}", READING.format(reference=arm_label(paper, entry.reference))]
    said += [_left_out(left_out, entry.least_skill), _missing(scores, paper)]
    for tasks in task_sets(scores):
        said += [_words(scores, tasks), picture(FIGURE, _file(entry, scores, tasks))]
        said += [_table(scores, tasks, paper, entry.reference)]
    said += [_answers(experiment, list(scores), entry)]
    said += [each_task(experiment, paper, entry) if entry.sections is not None else ""]
    return "\n\n".join(part.strip() for part in said if part)


def short_over_tasks(experiment: Experiment, paper: Paper, entry: Entry) -> str:
    """The tables alone, for the README and the notes.

    Raises:
        InvalidValueError: see `over_tasks`.
    """
    _check_reference(experiment, entry)
    scores, _ = _aggregated(experiment, entry)
    return "\n".join(_table(scores, tasks, paper, entry.reference) for tasks in task_sets(scores))


def draw_over_tasks(experiment: Experiment, paper: Paper, entry: Entry, figures: Path) -> list[Path]:
    """Writes the figures that `over_tasks` shows."""
    if len(experiment.tasks) < 2:
        return []
    (scores, _), found = _aggregated(experiment, entry), []
    for tasks in task_sets(scores):
        arms = arm_order(paper, arms_with(scores, tasks))
        drawn = tasks_figure(scores, tasks, arms, {arm: arm_label(paper, arm) for arm in arms})
        found.append(save_figure(drawn, figures / f"{_file(entry, scores, tasks)}.png"))
    return found


def _aggregated(experiment: Experiment, entry: Entry) -> tuple[TaskScores, dict[str, list[float]]]:
    """Scores of the tasks that are aggregated, and the skills of those that are not."""
    scores, least = experiment.scores(), entry.least_skill
    if least is None:
        return scores, {}
    skills = skills_of_tasks(experiment, entry.reference)
    unfit = {
        task: skills.get(task, []) for task in scores if min(skills.get(task) or [0.0]) < least - ROUNDING
    }
    return {task: arms for task, arms in scores.items() if task not in unfit}, unfit


def _left_out(tasks: dict[str, list[float]], least: float | None) -> str:
    """Which tasks are not aggregated, and their skills; nothing where none is left out."""
    if least is None or not tasks:
        return ""
    said = [
        f"`{task}` ({' '.join(f'{success:.3f}' for success in skills) or 'not tried alone'})"
        for task, skills in tasks.items()
    ]
    why = f"as a skill succeeds in less than {least:g} from its own starts, mean over seeds"
    return f"Left out, {why}: {', '.join(said)}."


def _answers(experiment: Experiment, tasks: Sequence[str], entry: Entry) -> str:
    """The questions declared over tasks, what was measured, and their answers; nothing if none was declared."""
    if not entry.task_questions:
        return ""
    scores, lines = experiment.scores(), []
    found = compare_over_tasks(scores, tasks, [each.pair for each in entry.task_questions])
    for question in entry.task_questions:
        measured = [row for row in found.itertuples() if (row.first, row.second) == question.pair]
        cells = [NOTHING, NOTHING, NOTHING]
        for row in measured:
            signs = _signs(*(int(value) for value in (row.ahead, row.behind, row.tasks)))
            cells = [interval(row.improvement, row.improvement_low, row.improvement_high)]
            cells += [f"[{row.seeds_low:.2f}, {row.seeds_high:.2f}]", signs]
        runs = paired_runs(scores, *question.pair)
        lines.append([question.asks, *cells, f"**{answer_over_tasks(question, found, runs)}**"])
    header = [
        "question, declared before",
        "probability of improvement [95%]",
        "seeds alone",
        "tasks ahead, tied, behind (sign test)",
    ]
    return table([*header, "answer"], lines)


def _signs(ahead: int, behind: int, tasks: int) -> str:
    """Tasks ahead, tied and behind, with the p-value of the side that has more than half."""
    said, most = f"{ahead}, {tasks - ahead - behind}, {behind}", max(ahead, behind)
    return f"{said} (p = {sign_test(most, tasks):.3f})" if most > tasks / 2 else said


def _words(scores: TaskScores, tasks: Sequence[str]) -> str:
    """Which tasks and arms a table is of."""
    named = ", ".join(f"`{task}`" for task in tasks)
    if len(tasks) < len(scores):
        return f"Over the {len(tasks)} tasks that every arm has: {named}."
    whose = ", the arms that have every one of them" if lacking_tasks(scores) else ""
    return f"Over all {len(tasks)} tasks{whose}: {named}."


def _file(entry: Entry, scores: TaskScores, tasks: Sequence[str]) -> str:
    return f"{entry.prefix}{'common' if len(tasks) < len(scores) else 'all'}_tasks"


def _check_reference(experiment: Experiment, entry: Entry) -> None:
    arms = sorted(set(experiment.arms["arm"]))
    if entry.reference not in arms:
        raise InvalidValueError(
            f"{FILE}: reference of {entry.folder.name} must be one of its arms {', '.join(arms)}, got {entry.reference}"
        )


def _table(scores: TaskScores, tasks: Sequence[str], paper: Paper, reference: str) -> str:
    """The arms that have all of these tasks."""
    found, lines = tasks_table(scores, tasks, reference), []
    for arm in arm_order(paper, map(str, found.index)):
        row = found.loc[arm]
        low, high = int(row["seeds_low"]), int(row["seeds_high"])
        line = [arm_label(paper, arm), str(len(tasks)), from_to(low, high)]
        lines.append([*line, *(interval_of(row, name) for name in ("progress", "success", "improvement"))])
    header = ["arm", "tasks", "seeds", "progress [95%]", "success [95%]"]
    return table([*header, f"improvement over {arm_label(paper, reference)} [95%]"], lines)


def _missing(scores: TaskScores, paper: Paper) -> str:
    """Which arms lack tasks or seeds that others have; nothing where none does."""
    lines = []
    for arm, tasks in lacking_tasks(scores).items():
        lines.append(f"- {arm_label(paper, arm)} has no run of {', '.join(f'`{task}`' for task in tasks)}.")
    if lines:
        lines.append(
            "- An arm that lacks a task is compared on the tasks that all arms have, and only there."
        )
        if not any(set(tasks) < set(scores) for tasks in task_sets(scores)):
            lines.append("- The arms have fewer than two tasks in common, so there is no such comparison.")
    for arm, tasks in lacking_seeds(scores).items():
        each = [f"seed {', '.join(map(str, seeds))} of `{task}`" for task, seeds in tasks.items()]
        lines.append(f"- {arm_label(paper, arm)} lacks {'; '.join(each)}.")
    return "Missing:\n\n" + "\n".join(lines) if lines else ""
