"""Tables that runs leave behind, and the numbers in them."""

import hashlib
import math
import os
import platform
import re
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest
import torch
import yaml
from saved_run import a_run

from tstar_rl.analysis.tables import commit_of, short_commit
from tstar_rl.checks import InvalidValueError
from tstar_rl.runs import versions
from tstar_rl.runs.chain_rows import terminal_state_rows
from tstar_rl.runs.csv_tables import MetricsLog, append_rows, rows_stay
from tstar_rl.runs.run_config import note_evaluation, read_config, write_config
from tstar_rl.runs.run_folder import Place, made_by, read_run_path, run_path, spent_by

ROOT = Path(__file__).resolve().parents[2]


def test_a_run_that_begins_again_is_not_finished(tmp_path):
    a_run(tmp_path).finish()
    run = a_run(tmp_path)
    done = run.work / "finished.json"
    assert done.is_file()
    run.start()
    assert not done.is_file()


def test_rows_that_are_added_together_read_as_those_that_are_added_one_by_one(tmp_path):
    """Also where one lacks a whole number that another has, which pandas would make a float of."""
    rows = [{"steps": 3, "loss": 0.1}, {"steps": 2**60, "kept": True}, {"loss": float("nan"), "kept": False}]
    one_by_one, together = MetricsLog(tmp_path / "a.csv"), MetricsLog(tmp_path / "b.csv")
    for log in (one_by_one, together):
        log.append({"steps": 1})
    for row in rows:
        one_by_one.append(row)
    together.extend(row for row in rows)
    together.extend([])
    text = together.path.read_text()
    assert text == one_by_one.path.read_text()
    assert text.splitlines() == ["steps,loss,kept", "1,,", "3,0.1,", f"{2**60},,True", ",,False"]
    assert together.rows == one_by_one.rows == 4


def test_a_path_is_read_as_it_was_made():
    for place in (Place("table", "tstar", 3, None), Place("chair", "ablations/links/2_links", 10, 2)):
        folder = run_path("", *place)
        assert read_run_path(folder) == (place, Path())
        assert read_run_path(folder / "last" / "skill1") == (place, Path("last/skill1"))
    for wrong in ("table/tstar/last", "table/seed0", "."):
        with pytest.raises(ValueError, match="a run lies at <task>/<system>/seed<k>"):
            read_run_path(Path(wrong))


def test_a_missing_run_is_told_what_makes_it_or_which_of_its_subtasks_are_there(tmp_path):
    run = run_path(tmp_path, "table_lack", "gail_ppo", 3)
    said = r": train it first \(python recipes/gail_ppo.py task=table_lack{} seed=3, with the scale and the folders gi"
    assert re.match(said.format(""), made_by(run / "last"))
    assert re.match(
        said.format(" subtask=2"), made_by(run_path(tmp_path, *Place("table_lack", "gail_ppo", 3, 2)))
    )
    for index in (0, 2):
        run_path(tmp_path, "table_lack", "gail_ppo", 3, index).mkdir(parents=True)
    assert (
        made_by(run / "last")
        == "; there are runs of subtask=0, 2, which system=no_finetuning skills=gail_ppo chains"
    )
    (run / "subtask2" / "unfinished").touch()
    assert made_by(run / "subtask2/last") == (
        f": its run, {run / 'subtask2'}, has not ended; the command that began it goes on with it"
    )
    nested = run_path(tmp_path, "table_lack", "wide/gail_ppo", 3, 1)
    assert made_by(nested) == ": train system=wide/gail_ppo of task=table_lack subtask=1 seed=3 first"
    for system, hint in (("tstr", "; did you mean tstar?"), ("tstar_costliest", "")):
        said = f": train system={system} of task=table_lack seed=3 first{hint}"
        assert made_by(run_path(tmp_path, "table_lack", system, 3)) == said
    assert made_by(tmp_path / "nowhere") == ""


def test_a_skill_that_a_chain_holds_is_told_where_it_lies(tmp_path):
    held = run_path(tmp_path, "table_lack", "tstar", 3) / "last/skill2"
    held.mkdir(parents=True)
    missing = run_path(tmp_path, "table_lack", "tstar", 3, 2) / "last"
    assert made_by(missing) == f": that skill of the chain is path={held}"


def test_the_config_of_a_training_stays_and_that_of_an_evaluation_follows_the_newest(tmp_path):
    run = a_run(tmp_path)
    run.start()
    note_evaluation(run.results, {"seed": 5})
    trained = yaml.safe_load((run.results / "config.yaml").read_text())
    assert trained["seed"] == 0 and "evaluation_only" not in trained
    for seed in (5, 6):
        note_evaluation(tmp_path / "script", {"seed": seed})
        noted = yaml.safe_load((tmp_path / "script" / "config.yaml").read_text())
        assert noted["seed"] == seed and noted["evaluation_only"] and noted["versions"] == trained["versions"]


def test_rows_that_stay_keep_the_commit_that_they_came_from(tmp_path, monkeypatch):
    key, file = ("checkpoint",), tmp_path / "script" / "evaluation.csv"

    def evaluate(commit, *checkpoints):
        monkeypatch.setattr(versions, "commit", lambda: commit)
        rows = [{"checkpoint": name, "success": 1.0} for name in checkpoints]
        note_evaluation(file.parent, {"seed": 5}, rows_stay(file, rows, key))
        append_rows(file, rows, key)
        return commit_of(file.parent)

    assert evaluate("a" * 40, "last") == "a" * 40
    assert evaluate("b" * 40, "best") == "+".join(("a" * 40, "b" * 40))
    assert evaluate("c" * 40, "last", "best") == "c" * 40
    kept = yaml.safe_load((file.parent / "config.yaml").read_text())
    assert kept["evaluation_only"] and "later" not in kept


def test_a_run_that_goes_on_or_is_evaluated_with_other_code_says_so(tmp_path, monkeypatch):
    def at(commit, env_steps=0):
        monkeypatch.setattr(versions, "commit", lambda: commit)
        run = a_run(tmp_path)
        assert run.start() == env_steps
        return run

    run = at("a" * 40)
    assert commit_of(run.results) == "a" * 40
    run.log(10, success_rate=1.0, completed=1.0)
    run.save_if_due(1)
    run.finish()
    for _ in range(2):  # said once
        again = at("b" * 40, 10)
        again.finish()
    kept = yaml.safe_load((run.results / "config.yaml").read_text())
    assert kept["versions"]["commit"] == "a" * 40 and kept["seed"] == 0
    (line,) = kept["later"]
    assert (line["what"], line["env_steps"], line["versions"]["commit"]) == ("resumed", 10, "b" * 40)
    monkeypatch.setattr(versions, "commit", lambda: "a" * 40)
    note_evaluation(run.results, {})  # as it began: nothing to say
    monkeypatch.setattr(versions, "commit", lambda: "c" * 40 + "-dirty")
    note_evaluation(run.results, {})
    assert commit_of(run.results) == "+".join(("a" * 40, "b" * 40, "c" * 40 + "-dirty"))
    assert short_commit(commit_of(run.results)) == "aaaaaaa+bbbbbbb+ccccccc-dirty"


def test_the_commit_is_that_of_the_code_wherever_a_run_is_started(tmp_path, monkeypatch):
    here = versions.versions()["commit"]
    monkeypatch.chdir(tmp_path)
    assert versions.versions()["commit"] == here
    monkeypatch.setenv("PATH", str(tmp_path))  # no git
    assert versions.versions()["commit"] == "unknown"


def test_a_program_outside_of_the_clone_is_named_with_its_digest(tmp_path, monkeypatch):
    script = tmp_path / "mine.py"
    script.write_text(
        "from pathlib import Path\nfrom tstar_rl.runs.run_config import write_config\n"
        "write_config(Path(__file__).parent, {'seed': 0})\n"
    )
    environ = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "envs")])}
    subprocess.run([sys.executable, str(script)], check=True, env=environ)
    digest = hashlib.sha256(script.read_bytes()).hexdigest()
    assert read_config(tmp_path)["script"] == f"mine.py sha256:{digest[:16]}"
    main = sys.modules["__main__"]  # of a worker of pytest-xdist, which has no file
    monkeypatch.setattr(main, "__file__", str(ROOT / "recipes" / "bc.py"), raising=False)
    write_config(tmp_path, {"seed": 0})
    assert "script" not in read_config(tmp_path)


def test_the_best_turn_of_a_chain_is_told_by_its_trials(tmp_path):
    run = a_run(tmp_path, trials=True)
    run.start()
    found = []
    for steps, trial in ((10, None), (20, 0.5), (30, None), (40, 0.4), (50, 0.5)):
        row = {"success_rate": 1.0, "completed": 1.0} | ({} if trial is None else {"trial_progress": trial})
        run.log(steps, **row)
        found.append(run.best.improved)
    assert found == [False, True, False, False, True]  # of equals, the newest


def test_the_best_of_a_training_is_told_by_the_mean_of_what_was_completed(tmp_path):
    run = a_run(tmp_path)
    run.start()
    found = []
    for completed in (math.nan, 0.0, 2.0, 1.0, 0.0):  # running means: -, 0, .4, .52, .416
        run.log(10 * len(found) + 10, success_rate=0.0, completed=completed)
        found.append(run.best.improved)
    assert found == [False, True, True, True, False]


def test_the_bar_says_the_mean_success_of_the_rows_so_far_and_then_of_the_last_ones(tmp_path):
    run = a_run(tmp_path)
    run.start()
    said = []
    for number, rate in enumerate((math.nan, 0.8, 0.6, math.nan, 1.0, 0.4, 0.2, 1.0, 0.5)):
        if number == 7:  # a run that is resumed goes on with the same mean
            run.save_if_due(0)
            run = a_run(tmp_path)
            run.start()
        run.log(10 * number + 10, success_rate=rate, completed=rate)
        said.append(run.bar.postfix)
    # Means of .8, of .8 and .6, ..., of all five; then a fifth of the way to 1 and to .5.
    rates = ["-", "0.80", "0.70", "0.70", "0.80", "0.70", "0.60", "0.68", "0.64"]
    assert said == [f"success={rate}" for rate in rates]


def test_terminal_states_and_the_best_so_far_are_resumed(tmp_path):
    run = a_run(tmp_path, trials=True)
    run.start()
    run.tables.terminal_states.extend(terminal_state_rows(5, 2, torch.tensor([[0.1234567, 1.0]])))
    run.log(10, trial_progress=0.8)
    run.save_if_due(0)
    run.tables.terminal_states.extend(terminal_state_rows(15, 2, torch.zeros(3, 2)))
    again = a_run(tmp_path, trials=True)
    assert again.start() == 10
    again.log(20, trial_progress=0.7)
    assert not again.best.improved
    table = pd.read_csv(tmp_path / "results" / "table" / "chain" / "seed0" / "terminal_states.csv")
    assert table.to_dict("records") == [{"env_steps": 5, "skill": 2, "pose_0": 0.12346, "pose_1": 1.0}]


def test_the_processor_is_named(tmp_path, monkeypatch):
    two = "vendor_id\t: GenuineIntel\ncpu family\t: 6\nmodel\t\t: 143\nmodel name\t: Intel(R) Xeon(R)\n"
    (tmp_path / "cpuinfo").write_text(two + "\n" + two)
    monkeypatch.setattr(torch.backends.cpu, "get_cpu_capability", lambda: "AVX2")
    machine = platform.machine()
    assert versions.processor(tmp_path / "cpuinfo") == f"{machine} GenuineIntel 6.143 AVX2"
    assert versions.processor(tmp_path / "none") == f"{machine} AVX2"
    assert versions.versions()["processor"] == versions.processor()


def test_what_a_run_took_is_not_read_by_halves(tmp_path):
    (tmp_path / "finished.json").write_text('{"env_steps": 10, "minutes": 0.5}')
    assert spent_by([tmp_path]) == {"env_steps": 10, "minutes": 0.5}
    for damage in ("", "{", "[1]", '{"env_steps": "many"}'):
        (tmp_path / "finished.json").write_text(damage)
        with pytest.raises(InvalidValueError, match=r"finished.json is damaged: put it back"):
            spent_by([tmp_path])
