"""A user's runs leave no trace: nothing is written where git looks, and the page reads what is published alone."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from hydra import compose, initialize_config_dir

ROOT = Path(__file__).resolve().parents[2]
CONFIGS = ROOT / "configs"
FOLDERS = ("results_dir", "runs_dir", "demonstrations_dir")


def ignored(paths: set[str]) -> set[str]:
    """Those of the paths that git ignores."""
    git = ["git", "-C", str(ROOT), "check-ignore", "--no-index", "--stdin"]
    try:
        done = subprocess.run(
            git, input="\n".join(sorted(paths)), capture_output=True, text=True, check=False
        )
    except FileNotFoundError:
        pytest.skip("no git here")
    if done.returncode == 128:
        pytest.skip(f"not a git checkout: {done.stderr}")
    return set(done.stdout.split())


def test_every_folder_that_a_config_names_is_ignored():
    written: dict[str, str] = {}
    for path in sorted(CONFIGS.rglob("*.yaml")):
        values = yaml.safe_load(path.read_text()) or {}
        for name in (
            FOLDERS if path.relative_to(CONFIGS) != Path("recipe/report.yaml") else ()
        ):  # it only reads
            if name in values:
                assert "published" not in Path(values[name]).parts, path
                # A table beside the runs, and one of a run.
                for file in ("bench.csv", "table_lack/tstar/seed0/evaluation.csv"):
                    written[f"{values[name]}/{file}"] = f"{name} of {path.relative_to(CONFIGS)}"
    assert {place.split(" of ")[1] for place in written.values()} >= {"base.yaml", "scale/gpu.yaml"}
    missing = {path: written[path] for path in set(written) - ignored(set(written))}
    assert not missing, f"git would see {missing}"


def test_what_is_published_is_not_ignored():
    published = {
        "results/published/contents.yaml",
        "results/published/new/table_lack/tstar/seed0/evaluation.csv",
        "results/published/new/table_lack/tstar/seed0/first_success.mp4",
    }
    assert not ignored(published)


@pytest.mark.parametrize(
    "name", ["results/mine.csv", "runs/table_lack/tstar", "demonstrations/a.npz", "outputs/x"]
)
def test_a_test_cannot_touch_what_a_user_has_made_here(name, monkeypatch):
    for path in (ROOT / name, str(ROOT / name)):
        with pytest.raises(PermissionError, match="belongs to whoever runs recipes here"):
            os.open(path, os.O_RDONLY)
    monkeypatch.chdir(ROOT)
    with pytest.raises(PermissionError, match="belongs to whoever runs recipes here"):
        (Path(name) / "folder").mkdir(parents=True)
    assert (ROOT / "results/published/contents.yaml").read_text()


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_a_users_runs_change_no_tracked_file(tmp_path):
    """The tracked files in a repository of their own, and what a newcomer does there, all folders as they come."""
    git = ["git", "-c", "user.name=a", "-c", "user.email=a@b", "-c", "commit.gpgsign=false", "-C"]

    def said(*command: str) -> str:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout

    tracked = said(
        "git", "-C", str(ROOT), "ls-files", "--cached", "--others", "--exclude-standard"
    ).splitlines()
    clone = tmp_path / "clone"
    for name in tracked:
        if (ROOT / name).is_file():
            (clone / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / name, clone / name)
    said(*git, str(clone), "init", "-q")
    said(*git, str(clone), "add", ".")
    said(*git, str(clone), "commit", "-qm", "all")
    environ = {**os.environ, "PYTHONPATH": os.pathsep.join([str(clone), str(clone / "envs")])}
    few = ["evaluation.whole_episodes=2", "evaluation.episodes=2", "evaluation.recorded=1"]
    small = [
        "scale=quick",
        "subtask=0",
        "demonstrations.episodes=2",
        "demonstrations.num_envs=8",
        "bc.epochs=1",
    ]
    small += ["training.num_envs=8", "training.horizon=16", "training.total_steps=256", "ppo.minibatch=64"]
    for name, *values in (
        ("make_demonstrations", *small),
        ("gail_ppo", *small),
        ("evaluate", "system=gail_ppo", "video=false", *small, *few),
        ("evaluate", "pretrained=table_lack", "+env.max_steps=40", *few),
        ("watch", "simulations=1", "subtask=0"),
    ):
        called = [sys.executable, f"recipes/{name}.py", *values]
        done = subprocess.run(called, env=environ, cwd=clone, capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"{name}: {done.stderr}"
    skill, chain = "table_lack/gail_ppo/seed0/subtask0", "table_lack/pretrained/tstar/seed0"
    for made in (f"runs/quick/{skill}/last", f"results/{chain}/evaluation.csv", "runs/watch.html"):
        assert (clone / made).exists(), made
    assert said("git", "-C", str(clone), "status", "--porcelain") == ""


@pytest.mark.slow
def test_the_report_reads_published_tables_and_changes_none(tmp_path):
    root, folder = tmp_path / "published", ROOT / "results" / "published"
    shutil.copytree(folder / "narrow_own_gate", root / "narrow_own_gate")
    experiments = yaml.safe_load((folder / "contents.yaml").read_text())["experiments"]
    kept = [entry for entry in experiments if entry["folder"] == "narrow_own_gate"]
    (root / "contents.yaml").write_text(yaml.safe_dump({"experiments": kept}))
    (tmp_path / "README.md").write_text("<!-- results: begin -->\n<!-- results: end -->\n")
    (tmp_path / "notes.md").write_text("Found.\n")
    before = {path: path.read_bytes() for path in root.rglob("*") if path.is_file()}
    values = [f"docs_dir={tmp_path}/docs", f"readme={tmp_path}/README.md", f"notes={tmp_path}/notes.md"]
    values += [f"paper={ROOT}/docs/paper_results.yaml", f"results_dir={root}", "figures=false"]
    environ = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "envs")])}
    command = [sys.executable, str(ROOT / "recipes" / "report.py"), *values]
    done = subprocess.run(command, env=environ, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert {path: path.read_bytes() for path in root.rglob("*") if path.is_file()} == before
    assert "each turn judged by the skill alone" in (tmp_path / "docs" / "results.md").read_text()
    assert "Found." in (tmp_path / "README.md").read_text()


def test_the_report_takes_published_tables_by_default():
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        assert compose("recipe/report").results_dir == "results/published"
