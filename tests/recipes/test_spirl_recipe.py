"""SPiRL's recipe, run as users run it."""

from pathlib import Path

import pandas as pd
import pytest
from recipe_runs import kill_after, places, run

import tstar_rl as rl
from tstar_rl.config.values import CONFIGS

SMALL = [
    "subtask=0",
    "spirl.model_training.epochs=2",
    "spirl.num_envs=8",
    "spirl.policy.first=16",
    "spirl.policy.minibatch=16",
    "spirl.total_steps=1600",
    "spirl.checkpoint_every=320",
]


@pytest.mark.parametrize("scale", sorted(path.stem for path in (CONFIGS / "spirl").glob("*.yaml")))
def test_its_config_says_at_every_scale_that_the_normaliser_stays(scale):
    assert rl.compose("spirl", "subtask=0", f"scale={scale}").normalizer.running is False


@pytest.mark.slow
def test_a_killed_run_resumes_to_the_same_figures(demonstrations, tmp_path):
    files = {}
    for name in ("whole", "killed"):
        values = [*SMALL, demonstrations, *places(tmp_path, name)]
        place = tmp_path / name / "results" / "table_lack" / "spirl" / "seed0" / "subtask0"
        files[name] = place / "metrics.csv"
        if name == "killed":
            rows = kill_after(12, files[name], "spirl", *values)
            assert 12 <= rows < 20, "it was not killed in the middle"
        done = run("spirl", *values)
        assert done.returncode == 0, done.stderr
    assert files["whole"].read_bytes() == files["killed"].read_bytes()
    table = pd.read_csv(files["whole"])
    assert table.held_out_error.notna().any() and table.divergence.notna().any()


@pytest.mark.slow
def test_what_it_saves_is_evaluated_like_a_skill(demonstrations, tmp_path):
    values = ["subtask=0", demonstrations, *places(tmp_path, "a")]
    done = run("spirl", *SMALL, *values, "spirl.total_steps=0", "spirl.model.decoder=open_loop")
    assert done.returncode == 0, done.stderr
    done = run(
        "evaluate",
        *values,
        "system=spirl",
        "checkpoints=[prior,last]",
        "evaluation.episodes=4",
        "video=false",
    )
    assert done.returncode == 0, done.stderr
    table = pd.read_csv(
        tmp_path / "a" / "results" / "table_lack" / "spirl" / "seed0" / "subtask0" / "evaluation.csv"
    )
    assert table.checkpoint.tolist() == ["prior", "prior", "last", "last"] and (table.episodes == 4).all()
    done = run("plot_latents", *values, "system=spirl", "states=2", "draws=3")
    assert done.returncode == 0, done.stderr
    assert Path(done.stdout.strip()).is_file()
    paths = pd.read_csv(Path(done.stdout.strip()).with_suffix(".csv"))
    assert paths.state.nunique() == 2 and sorted(paths.latent.unique()) == [-1, 0, 1, 2]
