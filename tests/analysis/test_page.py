"""docs/results.md: that it is what the published tables say, and that bad runs stay in it."""

import functools
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from published_runs import THEIRS, evaluation

from tstar_rl.analysis.differences import holm, paired_difference
from tstar_rl.analysis.exchanged import exchange_effects
from tstar_rl.analysis.experiments import SEED, compare_arms, read_experiment
from tstar_rl.analysis.page import curve_groups, replace_block, results_head, results_page, runs_page
from tstar_rl.analysis.page.contents import read_contents
from tstar_rl.analysis.page.experiment import answers
from tstar_rl.analysis.page.markdown import arm_label, arm_order, over_seeds
from tstar_rl.analysis.page.sections import comparison
from tstar_rl.analysis.page.skills import skills

ROOT = Path(__file__).resolve().parents[2]
PUBLISHED = ROOT / "results" / "published"
PAPER = yaml.safe_load((ROOT / "docs" / "paper_results.yaml").read_text())
NOTES = (ROOT / "docs" / "results_notes.md").read_text()


def test_the_pages_and_the_readme_are_what_the_published_tables_say():
    again = "run: python recipes/report.py"
    page = results_page(PUBLISHED, PAPER, NOTES)
    assert page == (ROOT / "docs" / "results.md").read_text(), again
    assert runs_page(PUBLISHED, PAPER) == (ROOT / "docs" / "every_run.md").read_text(), again
    readme = (ROOT / "README.md").read_text()
    assert replace_block(readme, results_head(PUBLISHED, PAPER, NOTES)) == readme, again


QUOTED = [
    "narrow_no_gate: tstar_no_gate - buffer_bonus_no_gate", "narrow_no_gate: tstar_no_gate - gaussian_no_gate",
    "narrow_skills: tstar - buffer_bonus", "narrow_skills: tstar - gaussian",
    "d_omega: tstar_no_gate - buffer_bonus_no_gate", "longer_chains: tstar_no_gate - buffer_bonus_no_gate",
    "longer_chains: tstar_no_gate - gaussian_no_gate", "sampled narrow_no_gate: tstar_no_gate - buffer_bonus_no_gate",
    "further_training: buffer_no_gate - no_finetuning", "further_training: tstar_no_gate - no_finetuning",
    "narrow_no_gate: buffer_no_gate - no_finetuning", "recovery: recover_always - no_finetuning", "exchanged: ends",
    "exchanged: taking over", "input_floor: floored - no_finetuning", "input_floor: tstar - no_finetuning",
    "input_floor chair_ingolf: floored - no_finetuning", "d_omega: tstar_no_gate - buffer_bonus_no_gate",
    "further_training: tstar_no_gate - buffer_bonus_no_gate", "further_training: tstar_no_gate - buffer_no_gate",
    "further_training: tstar_no_gate - gaussian_no_gate", "longer_chains: tstar_no_gate - buffer_bonus_no_gate",
    "longer_chains: tstar_no_gate - buffer_no_gate", "longer_chains: tstar_no_gate - gaussian_no_gate",
    "tstar - buffer_bonus", "tstar - buffer", "tstar - gaussian", "tstar_costliest - buffer_costliest",
    "narrow_skills: tstar - buffer_bonus", "narrow_skills: tstar - buffer", "narrow_skills: tstar - gaussian",
    "narrow_skills chair_ingolf: tstar - buffer_bonus", "narrow_skills chair_ingolf: tstar - buffer",
    "narrow_skills chair_ingolf: tstar - gaussian", "narrow_no_gate: tstar_no_gate - buffer_bonus_no_gate",
    "narrow_no_gate: tstar_no_gate - buffer_no_gate", "narrow_no_gate: tstar_no_gate - gaussian_no_gate",
    "narrow_no_gate: tstar_x10_no_gate - buffer_bonus_x10_no_gate",
    "narrow_no_gate: tstar_x10_no_gate - buffer_no_gate", "narrow_no_gate: tstar_x10_no_gate - gaussian_no_gate",
    "from_scratch: tstar - buffer_bonus", "from_scratch: tstar - gaussian", "further_training: buffer - own_starts",
    "further_training: own_starts - no_finetuning", "buffer - no_finetuning", "gaussian - no_finetuning",
    "narrow_no_gate: buffer_no_gate - no_finetuning", "narrow_no_gate: gaussian_no_gate - no_finetuning",
    "buffer_costliest - buffer", "in_order_cloned - tstar", "recovery: recover_always - no_finetuning",
    "input_floor: floored - no_finetuning", "input_floor chair_ingolf: floored - no_finetuning",
    "from_scratch: tstar - gaussian", "d_omega: tstar_no_gate - buffer_bonus_no_gate",
    "whole: tstar_no_gate - buffer_bonus_no_gate", "all: tstar - buffer_bonus", "both: tstar - gaussian",
    "both: tstar - buffer", "narrow_no_gate: tstar - tstar_no_gate", "input_floor: tstar - gaussian",
    "sampled narrow_skills: tstar - gaussian", "tstar_between_costliest - buffer_costliest",
    "tstar_between - buffer_bonus", "feasibility_costliest - buffer_costliest",
    "narrow_no_gate: feasibility_no_gate - tstar_no_gate", "narrow_skills: tstar - buffer_bonus",
    "sampled: buffer_costliest - buffer", "sampled: tstar_costliest - tstar", "sampled: floored - no_finetuning",
    "sampled: refitted - no_finetuning", "from_scratch: floored - no_finetuning", "floored - no_finetuning",
    "sampled terminal_state_regularisation: floored - no_finetuning",
    "terminal_state_regularisation chair_ingolf: floored - no_finetuning",
    "terminal_state_regularisation chair_ingolf: floored - floored_01",
    "narrow_skills chair_ingolf: floored - no_finetuning", "input_floor chair_ingolf: floored - no_finetuning",
    "input_floor: tstar - no_finetuning", "input_floor: floored - tstar", "input_floor: tstar - gaussian",
    "floored - no_finetuning", "buffer_costliest - buffer", "tstar_costliest - tstar",
    "in_order_demonstrated - in_order", "wider_starts_costliest - tstar", "wider_starts_costliest - gaussian",
    "wider_starts_costliest - buffer_costliest", "in_order_demonstrated - tstar", "in_order_demonstrated - gaussian",
    "tstar - buffer", "further_training: tstar_no_gate - buffer_no_gate",
    "d_omega: tstar_no_gate - buffer_bonus_no_gate", "recovery: recover_always - no_finetuning",
    "in_order_cloned - gaussian", "no_finetuning_jittered - no_finetuning", "gaussian - no_finetuning_jittered",
    "gaussian - no_finetuning", "in_order - tstar", "buffer_costliest - buffer", "tstar_costliest - tstar",
    "d_omega: tstar_no_gate - buffer_bonus_no_gate", "narrow_no_gate: tstar_no_gate - buffer_bonus_no_gate",
    "narrow_no_gate: feasibility_no_gate - feasibility_bonus_no_gate", "tstar_costliest - buffer_costliest",
    "feasibility_costliest - buffer_costliest", "from_scratch: tstar - gaussian", "from_scratch: tstar - buffer_bonus",
    "from_scratch: floored - no_finetuning", "narrow_skills: floored - tstar", "narrow_skills: tstar - no_finetuning",
    "narrow_skills: gaussian - no_finetuning", "narrow_skills: no_finetuning_jittered - no_finetuning",
    "narrow_skills: no_finetuning_jittered - floored", "narrow_skills: refitted - no_finetuning",
    "narrow_skills: tstar - gaussian", "sampled narrow_skills: tstar - gaussian",
    "narrow_skills: buffer_costliest - buffer", "narrow_skills: buffer_costliest - tstar",
    "narrow_skills: tstar - buffer_bonus", "narrow_skills: buffer_bonus - buffer", "narrow_skills: buffer - gaussian",
    "narrow_skills chair_ingolf: tstar - no_finetuning", "narrow_skills chair_ingolf: buffer - no_finetuning",
    "narrow_skills chair_ingolf: floored - no_finetuning", "narrow_skills chair_ingolf: tstar - buffer_bonus",
    "narrow_skills chair_ingolf: tstar - gaussian", "narrow_skills chair_ingolf: refitted - no_finetuning",
    "narrow_skills chair_ingolf: no_finetuning_jittered - no_finetuning",
    "shelf table_bjorkudden_0206: in_order_cloned - no_finetuning", "recovery: recover_always - no_finetuning",
    "recovery: recover - recover_blind", "recovery: recover_90 - no_finetuning", "recovery: recover_always - recover",
    "recovery: recover_late - no_finetuning", "further_training: own_starts - no_finetuning",
    "further_training: buffer - own_starts", "further_training: buffer - buffer_no_gate",
    "further_training: tstar_no_gate - gaussian_no_gate", "further_training: tstar_no_gate - buffer_bonus_no_gate",
    "further_training: tstar_no_gate - buffer_no_gate", "further_training: gaussian_bonus_no_gate - gaussian_no_gate",
    "further_training: gaussian_tsr_no_gate - gaussian_bonus_no_gate",
    "further_training: tstar_paper_schedule_no_gate - tstar_no_gate", "d_omega: tstar_no_gate - buffer_bonus_no_gate",
    "exchanged: ends", "exchanged: taking over", "longer_chains: tstar_no_gate - buffer_bonus_no_gate",
    "longer_chains: tstar_no_gate - gaussian_no_gate", "narrow_no_gate: buffer_no_gate - no_finetuning",
    "narrow_no_gate: gaussian_no_gate - no_finetuning", "narrow_no_gate: buffer_bonus_no_gate - no_finetuning",
    "sampled narrow_no_gate: buffer_bonus_no_gate - no_finetuning", "narrow_no_gate: tstar_no_gate - no_finetuning",
    "narrow_no_gate: tstar_no_gate - buffer_bonus_no_gate", "narrow_no_gate: tstar_no_gate - gaussian_no_gate",
    "sampled narrow_no_gate: tstar_no_gate - buffer_bonus_no_gate",
    "narrow_no_gate: tstar_x10_no_gate - tstar_no_gate",
    "narrow_no_gate: tstar_x10_no_gate - buffer_bonus_x10_no_gate",
    "narrow_no_gate: feasibility_no_gate - tstar_no_gate",
    "narrow_no_gate: feasibility_no_gate - feasibility_bonus_no_gate", "narrow_no_gate: tstar - tstar_no_gate",
    "narrow_skills: tstar - buffer_bonus", "feasibility_costliest - buffer_costliest",
    "narrow_no_gate: feasibility_no_gate - tstar_no_gate",
    "narrow_no_gate: feasibility_no_gate - feasibility_bonus_no_gate",
    "feasibility_share_costliest - buffer_costliest", "hand_over_value_costliest - buffer_costliest",
    "proximity_costliest - buffer_costliest", "scar_like_costliest - buffer_costliest",
    "tstar_between_costliest - buffer_costliest", "tstar_between - buffer_bonus",
    "narrow_no_gate: tstar_x10_no_gate - tstar_no_gate", "further_training: buffer - buffer_no_gate",
    "narrow_no_gate: tstar - tstar_no_gate", "hard_starts_costliest - buffer_costliest", "buffer_costliest - buffer",
    "narrow_skills: buffer_costliest - tstar", "wider_starts_costliest - buffer_costliest",
    "feasibility_costliest - buffer_costliest", "in_order_demonstrated - in_order_cloned",
]  # fmt: skip
"""The arms of each difference with an interval in the notes, in their order; the last two are the README's own.
Before the arms: the folder and the task, where these are not beyond_tstar and table_lack; `both` are that folder's arms
and those of further_training without the gate, seeds of both; `all` has those of d_omega beside them;
`exchanged` are effects at the first seam, of d_omega_exchanged.csv; `whole` is success, in d_omega; before a folder
`sampled` says that actions were."""


def rounded(number: float, digits: int) -> str:
    """As the notes write it: +.12."""
    return f"{number:+.{digits}f}".replace("0.", ".", 1)


def test_differences_in_the_text_are_those_of_the_tables_and_their_intervals_are_rounded_once():
    own = (ROOT / "README.md").read_text().split("<!-- results: end -->")[1]
    text = " ".join(f"{NOTES} {own}".split())
    quoted = re.findall(r"([+-]\.\d+)([^+]*?)95%: ([+-]\.\d+) to ([+-]\.\d+)", text)
    assert len(quoted) == len(QUOTED), [f"{value}{words}" for value, words, *_ in quoted]

    @functools.cache
    def rows(folder: str, task: str = "table_lack", mode: str = "deterministic") -> pd.DataFrame:
        if folder not in ("both", "all"):
            return read_experiment(PUBLISHED / folder).chosen(task, mode=mode)
        gated, kept = rows("beyond_tstar"), rows("further_training")
        kept = pd.concat([kept, rows("d_omega")] if folder == "all" else [kept])
        kept = kept[kept["arm"].str.endswith("_no_gate")]
        return pd.concat(
            [gated, kept.assign(arm=kept["arm"].str.removesuffix("_no_gate"))], ignore_index=True
        )

    def measured(named: str) -> tuple:
        folder, _, pair = named.rpartition(": ")
        if folder == "exchanged":
            effects = exchange_effects(pd.read_csv(PUBLISHED / "d_omega_exchanged.csv"))
            (row,) = effects[(effects["subtask"] == 1) & (effects["effect"] == pair)].itertuples()
            return row.value, row
        if folder == "whole":
            scores = read_experiment(PUBLISHED / "d_omega").scores()["table_lack"]
            one, other = ({k: s >= 1.0 for k, s in scores[arm].items()} for arm in pair.split(" - "))
            row = paired_difference(one, other, np.random.default_rng(SEED))
            return row.value, row
        mode = "stochastic" if folder.startswith("sampled") else "deterministic"
        place = folder.removeprefix("sampled").split() or ["beyond_tstar"]
        (row,) = compare_arms(rows(*place, mode=mode), [pair.split(" - ")]).itertuples()
        return row.difference, row

    wrong = []
    for named, (value, words, *ends) in zip(QUOTED, quoted, strict=True):
        mean, row = measured(named)
        found = [mean, min(row.low, mean - row.t_half), max(row.high, mean + row.t_half)]
        expected = [
            rounded(number, len(told.split(".")[1]))
            for number, told in zip(found, [value, *ends], strict=True)
        ]
        if [value, *ends] != expected:
            wrong.append(f"{named}: {value}{words}95%: {' to '.join(ends)}, but it is {', '.join(expected)}")
    assert not wrong


def test_what_the_notes_say_of_a_correction_for_all_questions_of_an_experiment():
    (entry,) = (one for one in read_contents(PUBLISHED).experiments if one.folder.name == "beyond_tstar")
    experiment = read_experiment(PUBLISHED / "beyond_tstar")
    rows = experiment.chosen("table_lack")
    told = answers(experiment, PAPER, entry, "table_lack").splitlines()[2:]
    corrected = holm([compare_arms(rows, question.pairs)["p_value"].max() for question in entry.questions])
    yes = [round(p, 2) for p, said in zip(corrected, told, strict=True) if said.endswith("**yes** |")]
    assert (len(corrected), sorted(yes)) == (18, [0.09, 0.09, 0.49, 0.53])
    assert "asks eighteen questions" in NOTES and ".09 for both about demonstrations" in NOTES
    assert ".49 for wider starts, .53 for whose turn it is" in NOTES


def test_every_figure_of_the_page_is_there_and_no_other():
    shown = set(re.findall(r"\]\(figures/([^)]+)\)", (ROOT / "docs" / "results.md").read_text()))
    prefixes = ("headline", *(entry.prefix for entry in read_contents(PUBLISHED).experiments))
    drawn = {
        path.name for path in (ROOT / "docs" / "figures").glob("*.png") if path.name.startswith(prefixes)
    }
    assert shown == drawn


def test_mean_and_deviation_over_seeds_by_hand():
    assert over_seeds(pd.Series([0.5, 0.7])) == "0.600 +- 0.141"  # 0.1 sqrt(2)
    assert over_seeds(pd.Series([0.25]), percent=True) == "25.0%"
    assert over_seeds(pd.Series([], dtype=float)) == "-"


def test_bad_runs_and_rows_of_only_one_side_stay():
    rows = [evaluation("tstar", 0, 1.0), evaluation("tstar", 1, 0.0), evaluation("tstar", 0, 0.5, "best")]
    rows.append(evaluation("mine", 0, 0.0))
    table = comparison(pd.DataFrame(rows), THEIRS, "table").splitlines()[2:]
    assert table == [
        "| BC | 0.03 +- 0.00 | - | - | - | - | - | not run |",
        "| T-STAR | 0.90 +- 0.07 | 87% | 0.500 +- 0.707 | 50.0 +- 70.7% | 0.500 | 50.0% | 2 |",
        "| mine | - | - | 0.000 | 0.0% | - | - | 1 |",
    ]


def test_a_skills_steps_are_those_of_its_whole_training():
    kept = {"prior": 0, "best": 1_000_000, "last": 3_000_000}
    rows = [evaluation("spirl", 0, 0.5, name, env_steps=steps) for name, steps in kept.items()]
    rows.append(evaluation("gail_ppo", 0, 0.5, "best", env_steps=1_000_000))
    table = skills(pd.DataFrame(rows).assign(subtask=2), "table").splitlines()[2:]
    assert table == [
        "| gail_ppo, subtask 2 | - | - | 50.0% | 1.00M | 1 |",
        "| spirl, subtask 2 | 50.0% | - | 50.0% | 3.00M | 1 |",
    ]


def test_curves_are_sorted_into_skills_chains_and_single_policies():
    rows = [
        {"recipe": "gail_ppo", "subtask": 2, "env_steps": 10},
        {"recipe": "tstar", "subtask": -1, "skill": 0, "env_steps": 10, "trial_progress": 0.5},
        {"recipe": "ppo", "subtask": -1, "env_steps": 10},
        {"recipe": "bc", "subtask": -1, "env_steps": 0},  # one row, no curve
    ]
    groups = curve_groups(pd.DataFrame(rows).assign(task="table"), "table")
    assert {name: list(group.recipe) for name, group in groups.items()} == {
        "skills": ["gail_ppo"],
        "chains": ["tstar"],
        "single_policies": ["ppo"],
    }
    assert curve_groups(pd.DataFrame(rows).assign(task="table"), "chair") == {}
    untrained = {"recipe": "recover", "subtask": -1, "skill": 1, "env_steps": 10}
    assert curve_groups(pd.DataFrame([untrained]).assign(task="table"), "table") == {}
    rows = [untrained, {**rows[0], "success_rate": 0.5}]
    assert list(curve_groups(pd.DataFrame(rows).assign(task="table"), "table")) == [
        "skills"
    ]  # nothing is trained


def test_arms_stand_in_the_order_of_the_file_with_their_variants():
    found = ["other", "tstar", "buffer_no_gate", "buffer", "tstar_no_gate"]
    expected = ["buffer", "buffer_no_gate", "tstar", "tstar_no_gate", "other"]
    assert arm_order(THEIRS, found) == expected


def test_an_arm_is_called_by_its_name_and_its_endings():
    assert arm_label(THEIRS, "tstar_paper_schedule_no_gate") == "T-STAR, as in the paper, every turn kept"
    assert arm_label(THEIRS, "mine_no_gate") == "mine, every turn kept"


def test_the_block_is_replaced_and_nothing_else():
    text = "a\n<!-- results: begin -->\nold\n<!-- results: end -->\nb\n"
    once = replace_block(text, "new")
    assert once == "a\n<!-- results: begin -->\nnew\n<!-- results: end -->\nb\n" == replace_block(once, "new")
    with pytest.raises(ValueError, match="needs one line <!-- results: begin -->"):
        replace_block("nothing", "new")
