"""Publishing finished runs."""

import errno
from concurrent.futures import ThreadPoolExecutor

import pytest

from tstar_rl.checks import InvalidValueError
from tstar_rl.experiments.published import publish
from tstar_rl.runs.csv_tables import LogError
from tstar_rl.runs.files import turn_to_write


def test_finished_runs_are_published_and_others_are_not(tmp_path):
    done, going = (tmp_path / f"a/table_lack/{arm}/seed7" for arm in ("tstar", "paid"))
    for folder in (done, going):
        folder.mkdir(parents=True)
        (folder / "metrics.csv").write_text("env_steps\n1\n")
    (done / "evaluation.csv").write_text("progress\n1\n")
    (done / "timing.csv").write_text("minutes\n1\n")
    written = publish(tmp_path / "a", tmp_path / "b")
    assert [file.relative_to(tmp_path).as_posix() for file in written] == [
        "b/table_lack/tstar/seed7/metrics.csv",
        "b/table_lack/tstar/seed7/evaluation.csv",
    ]


def test_a_run_that_was_evaluated_while_it_was_trained_is_not_finished(tmp_path):
    """What its training took is not known then, and its tables would pass for those of the whole of it."""
    for arm, steps in (("tstar", "1000.0"), ("paid", "")):
        folder = tmp_path / f"a/table_lack/{arm}/seed7"
        folder.mkdir(parents=True)
        (folder / "evaluation.csv").write_text(f"checkpoint,env_steps,progress\nbest,{steps},1\n")
    written = publish(tmp_path / "a", tmp_path / "b")
    assert [file.parent.parent.name for file in written] == ["tstar"]


def test_a_chain_of_skills_with_other_figures_is_not_published(tmp_path):
    """As where skills were made anew on another kind of processor."""
    skill = "t/gail_ppo/seed0/subtask0"
    for place, progress in (
        (f"a/{skill}", 0.5),
        (f"b/{skill}", 0.75),
        ("a/t/tstar/seed0", 0.5),
        ("a/t/bc/seed0", 0.5),
    ):
        (tmp_path / place).mkdir(parents=True)
        (tmp_path / place / "evaluation.csv").write_text(f"progress,minutes\n{progress},1\n")
    (tmp_path / "a/t/tstar/seed0/config.yaml").write_text(
        "skills: gail_ppo\nfrom_checkpoint: last\nversions: {commit: c}\n"
    )
    (tmp_path / "a/t/bc/seed0/config.yaml").write_text(
        "skills: bc\nfrom_checkpoint: last\nversions: {commit: c}\n"
    )
    with pytest.raises(
        ValueError, match=r"or of skills that were: .*b/t/gail_ppo.*, .*b/t/tstar/seed0/evaluation.csv; "
    ):
        publish(tmp_path / "a", tmp_path / "b")
    assert (tmp_path / "b/t/bc/seed0/evaluation.csv").is_file()
    assert not (tmp_path / "b/t/tstar/seed0/evaluation.csv").exists()


def test_runs_that_are_no_chains_of_such_skills_are_published(tmp_path):
    """Every config names skills, also that of a policy of the whole task, whose name may be that of skills."""
    whole, other, own = "t/gail_ppo/seed0", "t/ppo/seed0", "t/mine/gail_ppo/seed0/subtask0"
    for place, progress in ((f"b/{whole}", 0.75), *((f"a/{name}", 0.5) for name in (whole, other, own))):
        (tmp_path / place).mkdir(parents=True)
        (tmp_path / place / "evaluation.csv").write_text(f"progress,minutes\n{progress},1\n")
        (tmp_path / place / "config.yaml").write_text("skills: gail_ppo\nversions: {commit: c}\n")
    with pytest.raises(InvalidValueError, match=rf"that were: [^ ]*b/{whole}/evaluation.csv; delete"):
        publish(tmp_path / "a", tmp_path / "b")
    assert all((tmp_path / f"b/{name}/evaluation.csv").is_file() for name in (other, own))


def test_what_was_evaluated_below_a_run_is_not_published_as_one(tmp_path):
    """As `evaluate.py path=.../tstar/seed0/last/skill2` does."""
    for place in ("tstar/seed0", "tstar/seed0/last"):
        (tmp_path / "a/t" / place).mkdir(parents=True)
        (tmp_path / "a/t" / place / "evaluation.csv").write_text("progress\n1\n")
    written = publish(tmp_path / "a", tmp_path / "b")
    assert written == [tmp_path / "b/t/tstar/seed0/evaluation.csv"]


def test_runs_that_are_not_declared_stay_where_they_are(tmp_path):
    for arm, seed in (("tstar", 7), ("tstar", 1), ("own_starts", 7)):
        folder = tmp_path / f"a/table_lack/{arm}/seed{seed}"
        folder.mkdir(parents=True)
        (folder / "evaluation.csv").write_text("progress\n1\n")
    written = publish(tmp_path / "a", tmp_path / "b", lambda run: (run.system, run.seed) == ("tstar", 7))
    assert [file.relative_to(tmp_path).as_posix() for file in written] == [
        "b/table_lack/tstar/seed7/evaluation.csv"
    ]


@pytest.mark.parametrize("name", ["metrics.csv", "evaluation.csv"])
def test_a_table_that_is_cut_off_is_not_published_and_the_rest_is(tmp_path, name):
    for arm in ("one", "two"):
        folder = tmp_path / f"a/t/{arm}/seed0"
        folder.mkdir(parents=True)
        for table in ("metrics.csv", "evaluation.csv"):
            (folder / table).write_text("progress,minutes\n0.5,1\n")
    (tmp_path / "a/t/one/seed0" / name).write_text("progress,minutes\n0.5,1")
    with pytest.raises(LogError, match=f"one/seed0/{name} is damaged"):
        publish(tmp_path / "a", tmp_path / "b")
    assert not list((tmp_path / "b/t/one/seed0").iterdir())
    assert (tmp_path / "b/t/two/seed0/evaluation.csv").is_file()


def test_two_processes_that_publish_take_turns(tmp_path):
    (tmp_path / "a/t/one/seed0").mkdir(parents=True)
    (tmp_path / "a/t/one/seed0/evaluation.csv").write_text("progress\n1\n")
    with ThreadPoolExecutor(1) as pool, turn_to_write(tmp_path / "b/t/one/seed0"):
        writing = pool.submit(publish, tmp_path / "a", tmp_path / "b")
        with pytest.raises(TimeoutError):
            writing.result(0.2)
        (tmp_path / "b/t/one/seed0/evaluation.csv").write_text("progress\n1\n")
    assert writing.result() == []


def test_a_run_made_anew_with_the_same_figures_keeps_its_first_tables(tmp_path):
    for place, minutes, commit in (("a", 2, "new"), ("b", 1, "old")):
        folder = tmp_path / place / "table_lack/gail_ppo/seed7/subtask0"
        folder.mkdir(parents=True)
        (folder / "evaluation.csv").write_text(f"progress,minutes\n0.5,{minutes}\n")
        (folder / "config.yaml").write_text(f"commit: {commit}\n")
    assert publish(tmp_path / "a", tmp_path / "b") == []
    assert (folder / "config.yaml").read_text() == "commit: old\n"


def test_the_order_of_rows_is_no_other_figure(tmp_path):
    for place, rows in (("a", "best,0.5\nlast,0.7\n"), ("b", "last,0.7\nbest,0.5\n")):
        folder = tmp_path / place / "table_lack/gail_ppo/seed7/subtask0"
        folder.mkdir(parents=True)
        (folder / "evaluation.csv").write_text(f"checkpoint,progress\n{rows}")
    assert publish(tmp_path / "a", tmp_path / "b") == []


def test_other_figures_of_a_published_run_are_an_error_after_the_rest_is_copied(tmp_path):
    for place, progress in (("a/t/one/seed0", 0.5), ("a/t/two/seed0", 0.25), ("b/t/one/seed0", 0.75)):
        (tmp_path / place).mkdir(parents=True)
        (tmp_path / place / "evaluation.csv").write_text(f"progress,minutes\n{progress},1\n")
    with pytest.raises(
        ValueError, match=r"other figures than those in .*a, or .*: .*b/t/one/seed0/evaluation.csv; delete"
    ):
        publish(tmp_path / "a", tmp_path / "b")
    assert (tmp_path / "b/t/two/seed0/evaluation.csv").is_file()
    assert "0.75" in (tmp_path / "b/t/one/seed0/evaluation.csv").read_text()


@pytest.mark.parametrize("left", ["", "progress,min\n0.5"])
def test_a_table_that_was_half_written_counts_as_other_figures(tmp_path, left):
    for place in ("a/t/one/seed0", "a/t/two/seed0", "b/t/one/seed0"):
        (tmp_path / place).mkdir(parents=True)
        (tmp_path / place / "evaluation.csv").write_text("progress,minutes\n0.5,1\n")
    (tmp_path / "b/t/one/seed0/evaluation.csv").write_text(left)
    with pytest.raises(ValueError, match=r"other figures .*: .*b/t/one/seed0/evaluation.csv; delete these"):
        publish(tmp_path / "a", tmp_path / "b")
    assert (tmp_path / "b/t/two/seed0/evaluation.csv").is_file()


def test_a_copy_that_fails_leaves_no_table(tmp_path, monkeypatch):
    (tmp_path / "a/t/one/seed0").mkdir(parents=True)
    (tmp_path / "a/t/one/seed0/evaluation.csv").write_text("progress,minutes\n0.5,1\n")

    def full(source, target):
        target.write_text("prog")
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("tstar_rl.experiments.published.shutil.copyfile", full)
    with pytest.raises(OSError, match="No space"):
        publish(tmp_path / "a", tmp_path / "b")
    assert not list((tmp_path / "b/t/one/seed0").iterdir())


def test_a_folder_that_is_no_run_is_told_after_the_others_are_copied(tmp_path):
    for folder in ("t/tstar/seed0", "t/tstar/seed0_old"):
        (tmp_path / "a" / folder).mkdir(parents=True)
        (tmp_path / "a" / folder / "evaluation.csv").write_text("progress\n1\n")
    with pytest.raises(
        InvalidValueError, match=f"got t/tstar/seed0_old in {tmp_path / 'a'}: what is no run belongs"
    ):
        publish(tmp_path / "a", tmp_path / "b")
    assert [file.parent.name for file in (tmp_path / "b").rglob("evaluation.csv")] == ["seed0"]
