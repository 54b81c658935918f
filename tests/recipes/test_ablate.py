"""The command that makes an ablation, run as users run it."""

import subprocess
from pathlib import Path

import pandas as pd
import pytest
import yaml
from recipe_runs import run

SMALL = [
    "scale=quick", "progress_bar=false", "demonstrations.episodes=4", "demonstrations.num_envs=8", "bc.epochs=2",
    "training.num_envs=8", "training.horizon=16", "training.total_steps=0", "ppo.minibatch=64",
    "chain.steps_per_turn=256", "chain.trial_episodes=2", "chain.seed_episodes=4", "chain.trial_max_steps=10",
    "evaluation.episodes=2", "evaluation.whole_episodes=2",
]  # fmt: skip


def ablate(folder: Path, *values: str) -> subprocess.CompletedProcess[str]:
    where = [f"{name}_dir={folder / name}" for name in ("results", "runs", "demonstrations")]
    return run("ablate", *SMALL, *where, *values, small=False)


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_variants_are_made_once_shared_and_not_made_again(tmp_path):
    values = ["ablation=links", "variants=[4_links,2_links]"]
    done = ablate(tmp_path, *values)
    assert done.returncode == 0, done.stderr
    place = tmp_path / "results" / "table_lack" / "ablations"
    for subtask in range(4):
        assert (place / "skills" / "seed0" / f"subtask{subtask}" / "evaluation.csv").is_file()
    # All four links are T-STAR's default, which is d_omega's: trained there, its tables shared.
    shared, own = place / "links" / "4_links" / "seed0", place / "d_omega" / "tstar" / "seed0"
    for name in ("config.yaml", "metrics.csv", "evaluation.csv"):
        assert (shared / name).read_bytes() == (own / name).read_bytes()
    assert yaml.safe_load((own / "config.yaml").read_text())["skills"] == "ablations/skills"
    short = place / "links" / "2_links" / "seed0"
    assert set(pd.read_csv(short / "metrics.csv").skill) == {0, 1}
    assert pd.read_csv(short / "evaluation.csv")[["subtask_2", "subtask_3"]].isna().all(axis=None)

    times = {path: path.stat().st_mtime_ns for path in (tmp_path / "runs").rglob("finished.json")}
    again = ablate(tmp_path, *values)
    assert again.returncode == 0 and len(times) == 6, again.stderr
    assert times == {path: path.stat().st_mtime_ns for path in (tmp_path / "runs").rglob("finished.json")}
    other = ablate(tmp_path, *values, "ppo.epochs=7")
    assert other.returncode and "ppo.epochs was 2" in other.stderr and "resume=false" in other.stderr
