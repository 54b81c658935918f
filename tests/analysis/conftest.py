"""Tables that tests of experiments and of the page share."""

from pathlib import Path

import pandas as pd
import pytest
from arm_tables import write_arm, write_skills
from published_runs import contents, write


@pytest.fixture
def published(tmp_path) -> Path:
    """An experiment of two arms and two seeds, and tables beside the paper's."""
    for seed, ours, theirs in ((3, 0.75, 0.5), (4, 0.5, 0.255)):
        write(tmp_path, "odd", "tstar", seed, ours)
        write(tmp_path, "odd", "buffer_no_gate", seed, theirs)
    write(tmp_path, "plain", "tstar", 0, 1.0)
    own = {"system": "tstar", "checkpoint": "last", "own_starts": 1.0}
    steps = [{**own, "seed": seed, "subtask": 0} for seed in (3, 4)]
    steps += [{**own, "seed": seed, "subtask": 1, "handed_over": 0.5} for seed in (3, 4)]
    pd.DataFrame(steps).to_csv(tmp_path / "odd" / "table" / "hand_over.csv", index=False)
    (tmp_path / "odd" / "README.md").write_text("# Odd chains\n\nOf skills that are odd.\n")
    (tmp_path / "plain" / "README.md").write_text("# Plain: chains\n\nAs in the paper.\n")
    odd = {"folder": "odd", "kind": "experiment", "pairs": [["tstar", "buffer_no_gate"]]}
    contents(tmp_path, [odd, {"folder": "plain", "kind": "paper"}])
    return tmp_path


@pytest.fixture
def two_arms(tmp_path) -> Path:
    """Two arms of two seeds."""
    for seed, (one, other) in enumerate((([1.0, 0.9], [0.9, 0.6]), ([1.0, 0.7], [0.8, 0.4]))):
        write_arm(tmp_path, "tstar", seed, one)
        write_arm(tmp_path, "buffer", seed, other)
        write_skills(tmp_path, seed, [1.0, 0.95])
    return tmp_path
