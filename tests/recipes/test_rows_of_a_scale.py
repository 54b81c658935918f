"""Tables of speed, memory and parity: a row says of which task and scale it is, and stands for no other one's."""

import pandas as pd
import pytest
from recipe_runs import ROOT, load_recipe

RUNS = (
    ("table_lack", "laptop"),
    ("table_lack", "narrow"),
    ("chair_ingolf", "laptop"),
    ("table_lack", "laptop"),
)
"""The last one measures anew what the first one did."""
LEFT = [("table_lack", "narrow"), ("chair_ingolf", "laptop"), ("table_lack", "laptop")]


@pytest.fixture(autouse=True)
def _recipes(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "recipes")


def of_which(table: pd.DataFrame) -> list[tuple[str, str]]:
    return list(zip(table["task"], table["scale"], strict=True))


def test_the_bench_replaces_rows_of_the_same_task_and_scale_alone(call, tmp_path, monkeypatch):
    bench, rates = load_recipe("bench"), iter((100.0, 200.0, 300.0, 400.0))
    monkeypatch.setitem(bench.MEASURES, "single", lambda config, given: [{"bare": next(rates)}])
    older = pd.DataFrame([{"measure": "bare", "value": 50.0, "unit": "environment steps / s"}])
    older.to_csv(tmp_path / "bench.csv", index=False)  # of a version that noted neither
    values = ("bench.measures=[single]", "bench.starts=false", f"results_dir={tmp_path}")
    for task, scale in RUNS:
        call("bench", *values, f"task={task}", f"scale={scale}", module=bench)
    table = pd.read_csv(tmp_path / "bench.csv")
    assert table["value"].tolist() == [50.0, 200.0, 300.0, 400.0] and (table["measure"] == "bare").all()
    assert of_which(table)[1:] == LEFT and table.loc[0, ["task", "scale"]].isna().all()


def test_what_a_gpu_adds_is_of_its_own_scale(call, tmp_path, monkeypatch):
    bench, rates = load_recipe("bench"), iter((1.0, 2.0))
    monkeypatch.setattr(bench, "on_a_gpu", lambda given: [{"measure": "gpu_bare_2", "value": next(rates)}])
    for scale in ("laptop", "narrow"):
        values = ("bench.measures=[gpu]", "bench.starts=false", f"results_dir={tmp_path}", f"scale={scale}")
        call("bench", *values, module=bench)
    (row,) = pd.read_csv(tmp_path / "bench.csv").to_dict("records")
    assert (row["task"], row["scale"], row["value"]) == ("table_lack", "gpu", 2.0)


def test_growth_has_the_memory_of_one_process_for_each_task_and_scale(call, tmp_path, monkeypatch):
    growth, rollouts, rates = load_recipe("bench_growth"), iter((4, 4, 4, 2)), iter((1.0, 2.0, 3.0, 4.0))
    monkeypatch.setattr(
        growth,
        "measured",
        lambda given, *shape: {
            **dict(zip(("num_envs", "processes", "threads"), shape, strict=True)),
            "steps_per_second": next(rates),
        },
    )
    monkeypatch.setattr(
        growth,
        "memory",
        lambda config: iter([{"rollouts": n, "megabytes": 1.0} for n in range(1, next(rollouts) + 1)]),
    )
    monkeypatch.setattr(growth, "PARTS", ((1, 1),))
    for task, scale in RUNS:
        values = (f"results_dir={tmp_path}", f"task={task}", f"scale={scale}", "growth.sizes=[1]")
        call("bench_growth", *values, module=growth)
    table, memory = (pd.read_csv(tmp_path / f"{name}.csv") for name in ("growth", "growth_memory"))
    assert of_which(table) == LEFT and table["steps_per_second"].tolist() == [2.0, 3.0, 4.0]
    found = {of: rows["rollouts"].tolist() for of, rows in memory.groupby(["task", "scale"])}
    assert [found[of] for of in LEFT] == [[1, 2, 3, 4], [1, 2, 3, 4], [1, 2]]


def test_parity_replaces_rows_of_the_same_scale_alone(call, tmp_path, monkeypatch):
    parity, rates = load_recipe("parity"), iter((0.1, 0.2, 0.3, 0.4))
    monkeypatch.setattr(parity, "need_extra", lambda *_: None)
    monkeypatch.setattr(parity, "_success", lambda config, subtask: {"success_warp": next(rates)})
    monkeypatch.setattr(parity, "_parting", lambda config, subtask: {})
    for task, scale in RUNS:
        call(
            "parity", f"results_dir={tmp_path}", f"task={task}", f"scale={scale}", "subtask=0", module=parity
        )
    table = pd.read_csv(tmp_path / "parity.csv")
    assert of_which(table) == LEFT and table["success_warp"].tolist() == [0.2, 0.3, 0.4]
