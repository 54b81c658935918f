"""Steps that are run with the code and the configs of an earlier commit."""

import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from hydra import compose, initialize_config_dir

from tstar_rl.config.values import CONFIGS
from tstar_rl.launch import code_of_commit as made
from tstar_rl.launch.code_of_commit import code_of_commit, configs_of
from tstar_rl.launch.side_by_side import run_recipe
from tstar_rl.runs.files import turn_to_write

SAY = """
import os, pathlib, said
pathlib.Path("said.txt").write_text(f"{said.WORD} in {os.getcwd()}")
"""


def git(folder: Path, *command: str) -> str:
    me = ("-c", "user.name=a", "-c", "user.email=a@b")
    done = subprocess.run(
        ["git", "-C", str(folder), *me, *command], capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


@pytest.fixture
def repository(tmp_path) -> tuple[Path, list[str]]:
    """Two commits of a recipe, a library and a config that say "old", then "new"."""
    root, commits = tmp_path / "repository", []
    for name in ("recipes", "configs/recipe"):
        (root / name).mkdir(parents=True)
    git(root, "init")
    (root / "recipes/say.py").write_text(SAY)
    for word in ("old", "new"):
        (root / "said.py").write_text(f"WORD = {word!r}\n")
        (root / "configs/recipe/say.yaml").write_text(f"word: {word}\n")
        git(root, "add", "-A")
        git(root, "commit", "-m", word)
        commits.append(git(root, "rev-parse", "HEAD"))
    return root, commits


def test_a_recipe_of_an_earlier_commit_runs_here_with_the_library_of_that_commit(
    repository, tmp_path, monkeypatch
):
    root, (old, _) = repository
    place = code_of_commit(old, tmp_path / "code", root)
    assert place == code_of_commit(old, tmp_path / "code", root), "it is made once"
    monkeypatch.chdir(tmp_path)
    run_recipe(("say",), code=place)
    assert (tmp_path / "said.txt").read_text() == f"old in {tmp_path}"


def test_configs_of_an_earlier_commit_are_composed_meanwhile(repository, tmp_path):
    root, (old, new) = repository
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        for commit, word in ((old, "old"), (new, "new")):
            with configs_of(code_of_commit(commit, tmp_path / "code", root)):
                assert compose("recipe/say").recipe.word == word
        assert compose("recipe/gail_ppo").system == "gail_ppo"


def test_a_checkout_that_another_process_is_making_is_waited_for(repository, tmp_path):
    root, (old, _) = repository
    with ThreadPoolExecutor(1) as pool, turn_to_write(tmp_path / "code"):
        making = pool.submit(code_of_commit, old, tmp_path / "code", root)
        with pytest.raises(TimeoutError):
            making.result(0.3)
        assert not list((tmp_path / "code").iterdir())
    assert (making.result() / "said.py").is_file()


def test_a_commit_that_is_not_there_is_refused(repository, tmp_path):
    with pytest.raises(
        ValueError, match="commit 123456 is not in the repository .*: fetch it, or name a commit"
    ):
        code_of_commit("123456", tmp_path / "code", repository[0])


def test_a_branch_a_tag_and_an_upper_case_hash_name_their_commit(repository, tmp_path):
    root, (old, new) = repository
    git(root, "branch", "-M", "main")
    git(root, "tag", "v1.0", old)
    for name, commit in (("main", new), ("v1.0", old), (old.upper(), old), (new[:10], new)):
        for _ in range(2):  # made, and found again
            assert code_of_commit(name, tmp_path / "code", root) == tmp_path.resolve() / "code" / commit[:12]


def test_a_checkout_that_was_changed_is_refused(repository, tmp_path):
    root, (old, new) = repository
    place = code_of_commit(old, tmp_path / "code", root)
    (place / "said.py").write_text("WORD = 'mine'\n")
    with pytest.raises(
        ValueError, match=f"is to be the code of {old}, but it was changed: M said.py; delete it"
    ):
        code_of_commit(old, tmp_path / "code", root)
    git(place, "checkout", "--force", new)
    with pytest.raises(ValueError, match=f"is to be the code of {old}, but it is of {new}; delete it"):
        code_of_commit(old, tmp_path / "code", root)


def test_a_checkout_that_a_kill_cut_off_is_begun_anew(repository, tmp_path, monkeypatch):
    """Git has locked it then, and half of its files are there."""
    root, (old, _) = repository
    git_itself = made.subprocess.run

    def cut_off(command, **how):
        done = git_itself(command, **how)
        if "add" in command:
            place = Path(command[-2])
            (place / "said.py").unlink()
            Path(git(place, "rev-parse", "--git-dir"), "locked").write_text("initializing")
            raise KeyboardInterrupt
        return done

    monkeypatch.setattr(made.subprocess, "run", cut_off)
    with pytest.raises(KeyboardInterrupt):
        code_of_commit(old, tmp_path / "code", root)
    monkeypatch.undo()
    place = code_of_commit(old, tmp_path / "code", root)
    assert (place / "said.py").is_file() and [place] == list((tmp_path / "code").iterdir())


def test_a_checkout_that_was_deleted_is_made_anew(repository, tmp_path):
    root, (old, _) = repository
    place = code_of_commit(old, tmp_path / "code", root)
    (tmp_path / "code").rename(tmp_path / "gone")
    assert code_of_commit(old, tmp_path / "code", root) == place and (place / "said.py").is_file()
