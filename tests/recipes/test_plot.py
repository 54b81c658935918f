"""Curves and the table of what lies in a folder of results."""

import pandas as pd


def test_curves_of_each_system_and_the_table_of_all(call, tmp_path, capsys):
    for system, progress in (("tstar", 0.75), ("gaussian", 0.5)):
        folder = tmp_path / f"results/table_lack/{system}/seed0"
        folder.mkdir(parents=True)
        steps = {"env_steps": [100, 200], "success_rate": [0.0, progress], "skill": [0, 1]}
        pd.DataFrame(steps | {"completed": [1.0, 3.0], "phase": [2.0, 4.0]}).to_csv(
            folder / "metrics.csv", index=False
        )
        done = {
            "checkpoint": "last",
            "mode": "deterministic",
            "episodes": 4,
            "progress": progress,
            "success": 0.25,
        }
        done |= {"subtask_0": 1.0, "subtask_1": 0.25, "env_steps": 200, "minutes": 1.0, "seed": 0}
        pd.DataFrame([done]).to_csv(folder / "evaluation.csv", index=False)
    call("plot", f"results_dir={tmp_path / 'results'}")
    said = capsys.readouterr().out
    for system, progress in (("tstar", 0.75), ("gaussian", 0.5)):
        curves = tmp_path / f"results/table_lack/{system}/curves.png"
        assert curves.read_bytes().startswith(b"\x89PNG") and str(curves) in said
        (row,) = (line.split() for line in said.splitlines() if f" {system} " in line)
        assert [float(each) for each in row[-7:]] == [1, progress, 0.25, 1, 0.25, 200, 1]


def test_where_the_script_alone_was_evaluated_there_is_no_table(call, tmp_path, capsys):
    folder = tmp_path / "results/table_lack/expert/seed0"
    folder.mkdir(parents=True)
    (folder / "metrics.csv").write_text("env_steps,success_rate,completed,phase\n100,0.5,1,2\n200,0.6,1,2\n")
    row = "checkpoint,mode,seed,progress,success,env_steps,minutes\nscript,deterministic,0,1.0,1.0,0,0\n"
    (folder / "evaluation.csv").write_text(row)
    call("plot", f"results_dir={tmp_path / 'results'}")
    assert "Empty" not in capsys.readouterr().out
