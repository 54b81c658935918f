"""What was measured of a run goes with it; other runs' rows stay."""

import pandas as pd
import pytest
from saved_run import a_run

from tstar_rl.runs.csv_tables import LogError
from tstar_rl.runs.measured import _drop
from tstar_rl.runs.run_config import note_evaluation

ROWS = [("chain", 0), ("chain", 1), ("other", 0), ("no_finetuning", 0)]


def measured(folder, *names: str) -> None:
    (folder / "results/table").mkdir(parents=True, exist_ok=True)
    for name in names:
        rows = pd.DataFrame(ROWS, columns=["system", "seed"]).assign(progress=0.5)
        rows.to_csv(folder / f"results/table/{name}.csv", index=False)


def left(folder, name: str) -> list[tuple[str, int]]:
    table = pd.read_csv(folder / f"results/table/{name}.csv")
    return [(str(row["system"]), int(row["seed"])) for _, row in table.iterrows()]


def test_a_run_that_begins_anew_takes_its_measurements_with_it(tmp_path):
    names = (
        "hand_over",
        "hand_over_gap",
        "seams",
        "anatomy",
        "terminal_states_spread",
        "exchanged",
        "exchanged_other",
    )
    measured(tmp_path, *names, "exchanged_chain", "mine")
    run = a_run(tmp_path, resume=False)
    for name in ("evaluation", "moved_parts", "ways_home", "mine"):
        (run.results / f"{name}.csv").write_text("progress\n1\n")
    run.start()
    for name in names:
        assert left(tmp_path, name) == ROWS[1:], name
    assert left(tmp_path, "exchanged_chain") == [("chain", 1)], "each chain there was exchanged with this one"
    assert left(tmp_path, "mine") == ROWS, "what no recipe of ours wrote"
    assert [file.name for file in run.results.glob("*.csv")] == ["mine.csv"]


def test_a_run_that_goes_on_to_more_steps_does_so_too(tmp_path):
    run = a_run(tmp_path, training={"total_steps": 1})
    run.start()
    run.log(10)
    run.save_if_due(0)
    run.finish()
    measured(tmp_path, "hand_over_gap")
    a_run(tmp_path, training={"total_steps": 1}).start()
    assert left(tmp_path, "hand_over_gap") == ROWS, "it ends where it ended"
    a_run(tmp_path, training={"total_steps": 20}).start()
    assert left(tmp_path, "hand_over_gap") == ROWS[1:]


def test_a_skills_measurements_are_the_untrained_chains_too(tmp_path):
    measured(tmp_path, "seams")
    a_run(tmp_path, system="gail_ppo", skills="gail_ppo", resume=False).start()
    assert left(tmp_path, "seams") == ROWS, "a policy of the whole task is no skill"
    a_run(tmp_path, subtask=2, system="gail_ppo", skills="gail_ppo", resume=False).start()
    assert left(tmp_path, "seams") == ROWS[:3]


def test_chains_of_these_skills_under_another_name_go_too(tmp_path):
    measured(tmp_path, "seams")
    table = tmp_path / "results/table/seams.csv"
    table.write_text(table.read_text() + "no_finetuning_mine,0,0.5\nno_finetuning_theirs,0,0.5\n")
    for name, skills in (("mine", "gail_ppo_mine"), ("theirs", "gail_ppo")):
        folder = tmp_path / f"results/table/no_finetuning_{name}/seed0"
        folder.mkdir(parents=True)
        (folder / "config.yaml").write_text(f"skills: {skills}\nversions: {{commit: c}}\n")
        (folder / "moved_parts.csv").write_text("progress\n1\n")
    a_run(tmp_path, subtask=2, system="gail_ppo_mine", skills="gail_ppo", resume=False).start()
    assert left(tmp_path, "seams") == [*ROWS, ("no_finetuning_theirs", 0)]
    assert [file.parts[-3] for file in tmp_path.rglob("moved_parts.csv")] == ["no_finetuning_theirs"]


def test_the_usual_chain_of_other_skills_stays_and_one_whose_config_is_damaged(tmp_path):
    whole = "skills: {}\nversions: {{commit: c}}\n".format
    said = {"no_finetuning": whole("bc"), "no_finetuning_x": "", "a/no_finetuning_y": whole("gail_ppo")}
    for name, text in said.items():
        folder = tmp_path / f"results/table/{name}/seed0"
        folder.mkdir(parents=True)
        (folder / "config.yaml").write_text(text)
        (folder / "evaluation.csv").write_text("progress\n1\n")
    a_run(tmp_path, subtask=2, system="gail_ppo", skills="gail_ppo", resume=False).start()
    kept = sorted(file.parents[1].name for file in tmp_path.rglob("evaluation.csv"))
    assert kept == ["no_finetuning", "no_finetuning_x"]


def test_a_table_that_a_run_beside_has_just_deleted_is_no_error(tmp_path):
    _drop(tmp_path / "seams.csv", {"chain"}, 0)
    assert not (tmp_path / "seams.csv").exists()


def test_a_damaged_table_is_named_and_the_run_before_stays(tmp_path):
    run = a_run(tmp_path, resume=False)
    for name in ("last", "checkpoints"):
        (run.work / name).mkdir()
    (run.work / "finished.json").write_text("{}")
    (tmp_path / "results/table/seams.csv").write_text("system,seed\nchain,0")
    with pytest.raises(LogError, match="seams.csv is damaged"):
        run.start()
    assert (run.work / "last").is_dir() and (run.work / "checkpoints").is_dir()
    assert (run.work / "finished.json").is_file()


def test_films_and_pictures_of_a_run_go_too_and_a_table_of_the_users_own_stays(tmp_path):
    run = a_run(tmp_path, resume=False)
    for name in ("first_success.mp4", "first_failure.mp4", "episodes.html", "latents.png", "mine.png"):
        (run.results / name).write_text("")
    (tmp_path / "results/table/exchanged_means.csv").write_text("arm,mean\na,1\n")
    run.start()
    assert sorted(file.name for file in run.results.iterdir()) == ["config.yaml", "lock", "mine.png"]
    assert (tmp_path / "results/table/exchanged_means.csv").is_file()


def test_what_was_measured_of_one_skill_of_a_chain_goes_with_the_chain(tmp_path):
    """It lies below the run's own folder, with a config.yaml of its own; a file of somebody else's stays there."""
    run = a_run(tmp_path, resume=False)
    for name in ("last", "best"):
        note_evaluation(run.results / name, {"seed": 0})
        (run.results / name / "evaluation.csv").write_text("progress\n1\n")
    (run.results / "best/notes.txt").write_text("mine")
    run.start()
    assert not (run.results / "last").exists()
    assert [file.name for file in (run.results / "best").iterdir()] == ["notes.txt"]
