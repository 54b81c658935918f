"""The tool that kills recipes: what it counts, on programs of a second, and its short form on a real one."""

import random
import sys
from pathlib import Path

import kill_and_resume as tool
import pandas as pd
import pytest
from hydra import compose, initialize_config_dir
from recipe_runs import load_recipe

from tstar_rl.config.load import check_config
from tstar_rl.config.values import CONFIGS

RESUMES = """
import os, sys, time
from pathlib import Path
place = dict(value.split("=", 1) for value in sys.argv[1:])["results_dir"]
table = Path(place, "table.csv")
table.parent.mkdir(parents=True, exist_ok=True)
rows = table.read_text().splitlines() if table.exists() else ["row,minutes"]
while len(rows) < 11:
    time.sleep(0.05)
    rows.append(f"{len(rows)},{time.time()}")
    table.with_suffix(".new").write_text("\\n".join(rows) + "\\n")
    os.replace(table.with_suffix(".new"), table)
"""
STARTS_OVER = (
    RESUMES.replace("len(rows) < 11", "len(rows) < 11 or not sys.argv").replace(
        "rows = table", "began = table.exists(); rows = table"
    )
    + "\nif began: table.write_text(table.read_text() + 'again,0\\n')\n"
)
FAILS_AGAIN = RESUMES + "\nif len(sys.argv) > 1: raise SystemExit('cannot go on')\n"


def program(monkeypatch, folder: Path, code: str) -> tool.Subject:
    """A recipe of one second in the place of the project's."""
    (folder / "recipes").mkdir()
    (folder / "recipes" / "counter.py").write_text(code)
    monkeypatch.setattr(tool, "ROOT", folder)
    monkeypatch.setattr(tool, "TINY", [])
    return tool.Subject(("counter",), (), ("results/*.csv",))


def test_a_program_that_resumes_leaves_the_same_however_often_it_is_killed(monkeypatch, tmp_path):
    subject = program(monkeypatch, tmp_path, RESUMES)
    seconds = tool.untouched(subject, tmp_path / "whole", tmp_path / "whole")
    count = tool.torment(subject, tmp_path / "whole", tmp_path / "killed", 4, seconds, random.Random(0))
    assert (count.kills, count.failed, count.different) == (4, 0, 0) and count.completed >= 1
    table = pd.read_csv(tmp_path / "killed/results/table.csv")
    assert table.row.tolist() == [*range(1, 11)]  # minutes are measured, and differ


def test_a_program_that_does_not_resume_is_found_out(monkeypatch, tmp_path, capsys):
    subject = program(monkeypatch, tmp_path, STARTS_OVER)
    seconds = tool.untouched(subject, tmp_path / "whole", tmp_path / "whole")
    count = tool.torment(subject, tmp_path / "whole", tmp_path / "killed", 2, seconds, random.Random(0))
    assert count.kills == 2 and count.different >= 1
    assert "differs: results/table.csv" in capsys.readouterr().out


def test_a_program_that_fails_is_counted_and_said(monkeypatch, tmp_path, capsys):
    subject = program(monkeypatch, tmp_path, FAILS_AGAIN)
    with pytest.raises(SystemExit, match="cannot go on"):
        tool.untouched(subject, tmp_path / "whole", tmp_path / "whole")
    count = tool.torment(subject, tmp_path / "whole", tmp_path / "killed", 0, 1.0, random.Random(0))
    assert count.failed == 1 and "FAILED: cannot go on" in capsys.readouterr().out


@pytest.mark.parametrize("name", tool.SUBJECTS)
def test_its_recipes_take_its_values(name):
    recipe, *values = tool.SUBJECTS[name].command
    load_recipe(recipe)  # which names the keys of its own
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        check_config(compose(f"recipe/{recipe}", [*tool.TINY, *values]), recipe)


def test_a_recipe_that_the_pipeline_does_not_run_is_compared_with_its_own_run(tmp_path):
    subject = tool.Subject(("any",), (), ("results/signal.csv",))
    whole, alone = tmp_path / "whole", tmp_path / "alone"
    for folder, name in ((whole, "chain"), (alone, "signal")):
        (folder / "results").mkdir(parents=True)
        (folder / "results" / f"{name}.csv").write_text("row\n1\n")
    compared = tool.compared_with(subject, alone, whole)
    assert (compared / "results/signal.csv").is_file() and compared not in (whole, alone)
    assert not (whole / "results/signal.csv").exists()
    (whole / "results/signal.csv").write_text("row\n1\n")
    assert tool.compared_with(subject, alone, whole) == whole


@pytest.mark.slow
@pytest.mark.timeout(2400)
def test_every_kind_of_recipe_survives_a_kill(monkeypatch, tmp_path, capsys):
    """The short form of `python tools/kill_and_resume.py --kills 100`."""
    monkeypatch.setattr(
        sys, "argv", ["kill_and_resume.py", "--kills", str(len(tool.SUBJECTS)), "--keep", str(tmp_path)]
    )
    assert tool.main() == 0, capsys.readouterr().out
