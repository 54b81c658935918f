"""docs/results.md as text, and the block of it that the README shows.

The same published tables give the same text. Nothing is left out for being bad; what the paper lacks stands beside it.
"""

import re
from collections.abc import Iterable
from pathlib import Path

from tstar_rl.analysis.experiments import Experiment, read_experiment
from tstar_rl.analysis.page import experiment as parts
from tstar_rl.analysis.page import sections, skills
from tstar_rl.analysis.page.beside_the_paper import beside_the_paper
from tstar_rl.analysis.page.calibration import calibration
from tstar_rl.analysis.page.choices import choice_table
from tstar_rl.analysis.page.commits import commits
from tstar_rl.analysis.page.contents import Entry, read_contents
from tstar_rl.analysis.page.costs import costs
from tstar_rl.analysis.page.drawing import curves
from tstar_rl.analysis.page.exchanged import exchanged
from tstar_rl.analysis.page.goals import goal_table
from tstar_rl.analysis.page.late_trials import trials_over_time
from tstar_rl.analysis.page.markdown import Paper, anchor
from tstar_rl.analysis.page.over_tasks import over_tasks, short_over_tasks
from tstar_rl.analysis.page.pairs import readings, seams
from tstar_rl.analysis.page.single_policies import single_policies
from tstar_rl.analysis.page.turns import turns
from tstar_rl.analysis.tables import evaluations_of, read_metrics
from tstar_rl.checks import InvalidValueError

__all__ = ["replace_block", "results_head", "results_page"]

BEGIN, END = "<!-- results: begin -->", "<!-- results: end -->"
FINDINGS, MORE = "<!-- findings -->", "<!-- more -->"
WRITTEN = """\
<!-- Written by recipes/report.py from results/published/, docs/paper_results.yaml and docs/results_notes.md. -->
"""
READING = """\
## How to read the tables

Progress is the share of the subtasks that were done; success is the whole task. Evaluation is on fresh deterministic
episodes, from starts that nothing was trained or chosen on; where settings were tuned on a run's seed, the section says
so. In the columns "sampled", actions are drawn from the policy
instead.
*Last* is the last checkpoint. *Best* is, of a chain, the one that did best on trials of its own after each turn, and of
a single policy the one with the highest running mean of subtasks completed in training. The paper gives its best
checkpoint.

*Progress [95%]* and *success [95%]* are interquartile means over seeds (with fewer than four seeds: means). The
interval is a bootstrap over seeds, and over episodes within seeds. With fewer than some ten seeds it is too narrow, and
that of one seed is of its episodes alone. One that
ends where it begins, at 1 or 0, had no other episode: of n episodes, up to 3 in n may still be otherwise. So
a *difference* between two arms, paired by seed, has Student's t beside it, and is called higher or lower only where
both exclude zero. *Won* is on how many seeds the first arm has more. *Probability of improvement* is how often any seed
of the first arm beats any seed of the second, whether or not it is the same seed, a tie counting half; so it also
measures how far seeds are apart; with fewer than four seeds it has no interval. Where all seeds of one arm beat all of
the other, which a bootstrap takes for certain, the interval is Newcombe's (2006, method 5), which may be wider than the
bootstrap's of a little less. A verdict is of one pair:
it is not corrected for how many pairs a table has. In tables of questions the interval of
a difference reaches from the lower of the two lower ends to the higher of the two upper ends. Where a rule asks for a
probability of improvement, that stands behind it, with the p-value corrected for the family of pairs (Holm). *Within
0.05 of zero*, in tables of what a choice adds: both intervals are; other tables say *no clear difference* of such a
pair too. Other tables give mean +- standard deviation over seeds.

*Product of its skills* is the progress of a chain whose skills succeed as often from where the one before ends as from
their own starts. The *hand-over gap* is that product minus what the chain does: what better hand-overs alone can mend.
Both are plain means over seeds, while progress beside them is an interquartile mean, so they need not add up. Alone,
many skills start from parts that were jittered as in training, which can be harder than what the skill before leaves:
then the gap is negative, and the product no bound. Arms whose skills have other starts alone than these have neither.
Tables of several tasks together, beside the paper's or beside goals leave it out: it stands in the table *Arms* of the
same experiment and task; at the laptop scale, where it is about 0, *What the skills hand over* has what it is reckoned
from.

A dot is a seed unless the figure's caption says otherwise.

Answers to questions: *yes* and *no* follow the rule that was declared. *Not shown*: a rule that asks for much was not
met, a probability of improvement of .95, say. That compares any seed with any other: it says how far arms are apart,
not how sure we are, and an arm that is ahead on nine of ten paired seeds can have .70. *Not decided*: neither a gain
nor its absence can be told; where an interval is wider than .05 to each side, *no* was hardly within reach. *N seeds
probably would*: with N seeds the interval would exclude one of the two in four of five cases, if mean and spread stay
what they are.
"""


def results_page(root: str | Path, paper: Paper, notes: str) -> str:
    """The whole page.

    Args:
        root: of the published results, with contents.yaml.
        paper: docs/paper_results.yaml.
        notes: what was found, in a person's words; the page leads with it. `<!-- findings -->` becomes a list of links
            to its numbered headings; `<!-- more -->` says where what the README shows ends, and is left out.
    """
    entries = read_contents(root).experiments
    found = [_experiment(entry, paper) for entry in entries]
    said = _filled(notes.replace(FINDINGS, _findings(notes)).replace(f"{MORE}\n\n", ""), entries, paper)
    return "\n\n".join(part.strip() for part in ("# Results", WRITTEN, said, READING, *found)) + "\n"


def _findings(notes: str) -> str:
    """The headings of the numbered findings, `### 1. ...`, as links."""
    headings = re.findall(r"^### (\d+\. .*)$", notes, flags=re.MULTILINE)
    return "\n".join(f"- [{heading}](#{anchor(heading)})" for heading in headings)


def _filled(notes: str, entries: Iterable[Entry], paper: Paper) -> str:
    """The notes with the tables that they ask for.

    `<!-- table: <folder> -->` is one, `<!-- table: <folder>: <arm>, <arm> -->` has these arms alone, and so has
    `goals`; `readings` and `seams` have two, and `beside the paper` has other experiments. In the place of `table`
    there are also `comparisons`, `answers`, `choices`, and of several tasks `over all tasks`, each with all arms.

    Raises:
        InvalidValueError: for a folder that is no experiment, an arm that it does not have, a table that would be
            empty, or a comment that asks for nothing: it would not be seen.
    """
    experiments = {entry.folder.name: entry for entry in entries if entry.kind == "experiment"}
    chosen = {"table": parts.short_table, "goals": goal_table, "readings": readings, "seams": seams}
    chosen["beside the paper"] = beside_the_paper
    written = {"comparisons": parts.comparison_table, "answers": parts.answers, "choices": choice_table}

    def fill(found: re.Match[str]) -> str:
        kind, folder, arms = found.groups()
        if folder not in experiments:
            raise InvalidValueError(
                f"{found[0]}: there is no such experiment; there are {', '.join(experiments)}"
            )
        if arms and kind not in chosen:
            raise InvalidValueError(f"{found[0]}: {kind} are of all arms")
        entry = experiments[folder]
        experiment, named = read_experiment(entry.folder), entry.named(paper)
        if kind == "over all tasks":
            return _some(found[0], short_over_tasks(experiment, named, entry))
        shown = {
            task: written[kind](experiment, named, entry, task)
            if kind in written
            else chosen[kind](experiment, named, entry, task, arms.split(", ") if arms else ())
            for task in sections.in_order(paper, experiment.tasks)
        }
        several = len(experiment.tasks) > 1
        filled = (f"`{task}`:\n\n{text}" if several else text for task, text in shown.items() if text)
        return _some(found[0], "\n".join(filled))

    kinds = "|".join((*chosen, *written, "over all tasks"))
    asked = rf"<!-- ({kinds}): ([^\s:]+)(?:: ([\w, ]+))? -->"
    if left := re.findall("<!--.*", re.sub(asked, "", notes)):
        raise InvalidValueError(f"the notes have a comment that is no table: {left[0]}")
    return re.sub(asked, fill, notes)


def _some(asked: str, text: str) -> str:
    if not text.strip():
        raise InvalidValueError(f"{asked}: there is nothing to show")
    return text.strip()


def _experiment(entry: Entry, paper: Paper) -> str:
    """The part of the page that an experiment fills.

    Raises:
        InvalidValueError: if its arms come from several commits and contents.yaml does not say so, or that file names a
            task or an arm that there is not.
    """
    said, paper = [f"#{entry.intro()}"], entry.named(paper)
    if entry.kind == "ablations":
        return "\n\n".join([*said, sections.ablated(entry.folder)])
    evaluations, metrics = evaluations_of(entry.folder), read_metrics(entry.folder)
    experiment = None if entry.kind == "paper" else read_experiment(entry.folder, entry.commits == "one")
    if experiment:
        _check_names(entry, experiment)
    said.append(commits(experiment) if experiment else "")
    said.append(f"[Every run of it](every_run.md#{anchor(entry.title)}), seed by seed.")
    said.append(over_tasks(experiment, paper, entry) if experiment and entry.kind == "experiment" else "")
    for task in filter(entry.has_section, sections.in_order(paper, evaluations["task"])):
        said.append(f"### {entry.title}: {task}")
        leads: dict[str, str] = {}
        if entry.kind == "paper":
            leads["The paper's table and ours"] = sections.comparison(evaluations, paper, task)
            leads["Budgets"] = sections.budgets(evaluations, paper, task)
        elif entry.kind == "single_policies":
            leads["How far each policy gets"] = single_policies(evaluations, paper, task)
        elif experiment and task in experiment.tasks:
            leads["Questions"] = parts.answers(experiment, paper, entry, task)
            leads["Arms"] = parts.arms(experiment, paper, entry, task)
            leads["Comparisons"] = parts.comparisons(experiment, paper, entry, task)
            leads["Costs"] = costs(metrics, task, entry.prefix)
            leads["Turns"] = turns(metrics, paper, task, entry.prefix)
            leads["Calibration"] = calibration(entry.folder, metrics, paper, task, entry.prefix)
            leads["Skills exchanged"] = exchanged(entry, paper, task)
            leads["Later trials"] = trials_over_time(metrics, paper, task, entry.late_trials)
        leads["What the skills hand over"] = sections.hand_over(entry.folder, task, paper, entry.prefix)
        leads["What each aid is worth"] = skills.aids(entry.aids, evaluations, paper, task)
        leads["Which skills are learned"] = skills.learned(entry.learned, evaluations, task)
        leads["Skills alone"] = skills.skills(evaluations, task)
        leads["Where the third skill ends: the paper's Figure 4"] = sections.figure_4(
            entry.folder, task, paper, entry.prefix
        )
        leads["Curves"] = curves(metrics, task, entry.prefix)
        said += [f"#### {title}\n\n{text.strip()}" for title, text in leads.items() if text]
    return "\n\n".join(part.strip() for part in said if part)


def _check_names(entry: Entry, experiment: Experiment) -> None:
    arms = set(experiment.arms["arm"]) if len(experiment.arms) else set()
    for field, named, there in (
        ("sections", entry.sections or (), set(experiment.tasks)),
        ("no_gap", entry.no_gap, arms),
        ("figure_arms", entry.figure_arms, arms),
    ):
        if unknown := sorted(set(named) - there):
            raise InvalidValueError(
                f"contents.yaml: {field} of {entry.folder.name} have {', '.join(unknown)}; there are "
                f"{', '.join(sorted(there)) or 'none'}"
            )


def results_head(root: str | Path, paper: Paper, notes: str) -> str:
    """What the README shows: what the notes begin with, up to `<!-- more -->` or their first heading.

    Args:
        root: see `results_page`.
        paper: see `results_page`.
        notes: see `results_page`; links and pictures are changed to lead from the README's folder.
    """
    lead = re.split(rf"^(?:#|{MORE})", notes, maxsplit=1, flags=re.MULTILINE)[0].replace(
        "](#", "](results.md#"
    )
    lead = re.sub(r"\]\((?!https?:)", "](docs/", lead)
    return _filled(lead, read_contents(root).experiments, paper).strip()


def replace_block(text: str, block: str) -> str:
    """The text with what is between the two markers replaced.

    Raises:
        InvalidValueError: if the markers are not there, or not in this order.
    """
    if text.count(BEGIN) != 1 or text.count(END) != 1 or text.index(END) < text.index(BEGIN):
        raise InvalidValueError(f"the text needs one line {BEGIN} and, after it, one line {END}")
    before, rest = text.split(BEGIN)
    return f"{before}{BEGIN}\n{block.strip()}\n{END}{rest.split(END)[1]}"
