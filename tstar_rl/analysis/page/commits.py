"""Which commits the runs of an experiment come from, as a part of the page."""

from tstar_rl.analysis.experiments import Experiment
from tstar_rl.analysis.tables import short_commit

__all__ = ["commits"]


def commits(experiment: Experiment) -> str:
    """A sentence that names the commits of the arms and of the skills that were evaluated alone."""
    found = experiment.commits()
    if len(found) == 1:
        return f"All runs come from commit {short_commit(next(iter(found)))}.\n"
    parts = []
    for commit, runs in found.items():
        seeds: dict[str, dict[str, list[str]]] = {}
        for run in runs:
            task, rest = run.split("/", 1)
            arm, seed = rest.rsplit("/", 1)  # an arm's own skills are those of <arm>/<recipe>
            seeds.setdefault(task, {}).setdefault(arm, []).append(seed.removeprefix("seed"))
        named = "; ".join(f"`{task}`: {_with_seeds(arms)}" for task, arms in seeds.items())
        parts.append(f"- {short_commit(commit)}: {named}\n")
    return "The runs come from several commits:\n\n" + "".join(parts)


def _with_seeds(arms: dict[str, list[str]]) -> str:
    """Arms with the same seeds stand together."""
    alike: dict[str, list[str]] = {}
    for arm, seeds in arms.items():
        alike.setdefault(", ".join(seeds), []).append(f"`{arm}`")
    return ", ".join(f"{', '.join(names)} (seed {seeds})" for seeds, names in alike.items())
