"""CSV tables and configs of runs: what is read is what was written, and a damaged file is named."""

import pandas as pd
import pytest

from tstar_rl.runs.csv_tables import LogError, MetricsLog, append_rows, read_table
from tstar_rl.runs.run_config import DamagedConfigError, read_config


def test_a_log_cut_back_goes_on_as_if_it_had_never_gone_further(tmp_path):
    whole, cut = MetricsLog(tmp_path / "whole.csv"), MetricsLog(tmp_path / "cut.csv")
    rows = [{"a": 1, "b": 0.1}, {"a": 2, "b": float("nan")}, {"a": 3, "c": 5.0}]
    for row in rows:
        whole.append(row)
    for row in rows:
        cut.append(row)
    again = MetricsLog(tmp_path / "cut.csv")
    again.truncate(1)
    for row in rows[1:]:
        again.append(row)
    assert (tmp_path / "cut.csv").read_bytes() == (tmp_path / "whole.csv").read_bytes()
    assert list(pd.read_csv(tmp_path / "whole.csv").columns) == ["a", "b", "c"]


def test_a_log_shorter_than_its_checkpoint_says_is_refused(tmp_path):
    log = MetricsLog(tmp_path / "log.csv")
    log.append({"a": 1})
    with pytest.raises(ValueError, match="has 1 whole rows, but its checkpoint counts 4"):
        log.truncate(4)


def test_evaluation_rows_replace_those_of_the_same_key(tmp_path):
    path, key = tmp_path / "evaluation.csv", ("checkpoint", "mode")
    assert append_rows(path, [], key).empty and not path.exists()
    append_rows(path, [{"checkpoint": "last", "mode": "deterministic", "success": 0.1}], key)
    assert len(append_rows(path, [], key)) == 1 == len(pd.read_csv(path))
    append_rows(path, [{"checkpoint": "best", "mode": "deterministic", "success": 0.2}], key)
    table = append_rows(path, [{"checkpoint": "last", "mode": "deterministic", "success": 0.3}], key)
    assert sorted(table.success) == [0.2, 0.3] and sorted(pd.read_csv(path).success) == [0.2, 0.3]


@pytest.mark.parametrize(
    "damage",
    [
        b"",
        b"seed,success",
        b"seed,success\n0,0.",
        b"seed\n\xff\xfe\n",
        b'a,b\n"0,1\n',
        b"a,b\n0,1\n2\n",
        b'a,b\n"0,1\n' + b"2,3\n" * 50_000,
    ],
)
def test_a_damaged_table_is_named(tmp_path, damage):
    path = tmp_path / "evaluation.csv"
    path.write_bytes(damage)
    for read in (lambda: read_table(path), lambda: append_rows(path, [{"seed": 1}], ("seed",))):
        with pytest.raises(LogError, match=r"evaluation.csv is damaged \(.*put it back from a copy"):
            read()
    assert path.read_bytes() == damage


@pytest.mark.parametrize(
    "damage",
    [
        b"",
        b"a: [",
        b"seed: 0\nenv: {velocity",
        b"seed: 0\nenv: 1",
        b"seed: 0\n",  # cut at the end of a line
        b"seed: 0\nversions:\n  torch: 2.13.0\n",
        b"\xff\xfe",
    ],
)
def test_a_damaged_config_is_named(tmp_path, damage):
    (tmp_path / "config.yaml").write_bytes(damage)
    with pytest.raises(DamagedConfigError, match=r"config.yaml is damaged \(.*put it back from a copy"):
        read_config(tmp_path)


def test_a_key_of_numbers_and_words_is_the_same_after_it_was_read_back(tmp_path):
    path, key = tmp_path / "parity.csv", ("subtask",)
    for success in (0.1, 0.2):
        for subtask in (0, "whole"):
            table = append_rows(path, [{"subtask": subtask, "success": success}], key)
    assert list(table.success) == [0.2, 0.2] and len(pd.read_csv(path)) == 2


def test_a_column_added_by_a_process_that_is_killed_loses_nothing(tmp_path, monkeypatch):
    log = MetricsLog(tmp_path / "log.csv")
    log.append({"a": 1})

    def killed(*places):
        raise KeyboardInterrupt

    monkeypatch.setattr("os.replace", killed)
    for change in (lambda: log.append({"a": 2, "b": 3}), lambda: log.truncate(1)):
        with pytest.raises(KeyboardInterrupt):
            change()
        assert (tmp_path / "log.csv").read_text() == "a\n1\n"


def test_a_log_goes_on_whatever_its_names_and_fields_hold(tmp_path):
    row = {"a": 1, "x,y": "one\x1c\u2028line"}
    for names in (("log.csv", "a"), ("other.csv", None)):
        log = MetricsLog(tmp_path / names[0], names[1])
        log.extend([row, row])
        again = MetricsLog(tmp_path / names[0], names[1])
        again.truncate(1)
        again.append({**row, "b": 2})
        table = read_table(tmp_path / names[0])
        assert list(table.columns) == ["a", "x,y", "b"] and table["x,y"].tolist() == [row["x,y"]] * 2
    with pytest.raises(LogError, match="its first column is not b"):
        MetricsLog(tmp_path / "log.csv", "b").check(1)
