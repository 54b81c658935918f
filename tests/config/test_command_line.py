"""A user's mistake on the command line ends in one or two lines: what was got, what is valid, where it belongs."""

import logging
import os
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest
from recipe_runs import ROOT, command, environ

from tstar_rl import checks
from tstar_rl.chaining.skill import Skill
from tstar_rl.checks import NothingToDo, UserError
from tstar_rl.config.command_line import FULL_ERROR, HINT, STOPPED, told_in_words
from tstar_rl.config.load import recipe
from tstar_rl.models.network_settings import NetworkSettings
from tstar_rl.runs.run_folder import run_path

SMALL = NetworkSettings(hidden=(16,), std="fixed", discriminator_hidden=(16,))


def test_a_checkpoint_that_belongs_elsewhere_or_is_damaged_is_told_in_words(say):
    place = run_path("runs", "table_lack", "gail_ppo", 0, 0) / "last"
    Skill("table_lack", 1, SMALL).save(place)
    assert re.search("subtask0/last does not belong here: subtask was 1 .*is 0 now", say("tstar"))
    (place / "manifest.json").unlink()
    assert re.search("last is damaged: manifest.json is missing", say("evaluate", f"path={place}"))
    assert re.search("subtask0/last is damaged: manifest.json is missing", say("tstar"))


def test_work_that_is_done_is_told_and_is_no_failure(capsys):
    with pytest.raises(SystemExit) as ended, told_in_words():
        raise NothingToDo("seed0 has finished")
    assert ended.value.code == 0 and capsys.readouterr().out == "seed0 has finished\n"


def test_a_copy_of_a_recipe_that_was_not_renamed_does_not_run_as_the_first(tmp_path):
    """It would read the first one's values, and find the first one's run."""
    copy = tmp_path / "recipes" / "mine.py"
    copy.parent.mkdir()
    copy.write_text((ROOT / "recipes" / "bc.py").read_text())
    with pytest.raises(
        SystemExit, match=r'mine.py is the recipe "bc" by its @rl.recipe: name it "mine" there'
    ):
        runpy.run_path(str(copy))


def test_a_missing_extra_is_told_in_words(say, monkeypatch):
    monkeypatch.setattr(checks, "find_spec", lambda name: None)
    assert re.search(
        r"launch=ray .*needs ray, which is not installed: .*install -e '.\[ray\]'",
        say("assemble", "launch=ray"),
    )
    assert re.search(r"needs mujoco_warp, .*install -e '.\[gpu\]'", say("gail_ppo", "physics=warp"))


def test_a_device_that_is_not_there_is_told_in_words(say, monkeypatch):
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    assert "torch finds no CUDA device on this machine" in say("gail_ppo", "device=cuda")
    monkeypatch.setattr("torch.cuda.is_available", lambda: True)
    monkeypatch.setattr("torch.cuda.device_count", lambda: 2)
    assert "device=cuda:2: torch finds cuda:0 to cuda:1" in say("gail_ppo", "device=cuda:2")


def test_an_error_of_the_program_is_no_message(monkeypatch, capfd, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["plot.py"])

    def fails(config):
        raise ValueError("not the user's")

    with pytest.raises(SystemExit) as ended:
        recipe("plot")(fails)()
    told = capfd.readouterr().err
    assert ended.value.code == 1 and "Traceback" in told and "in fails" in told and "not the user's" in told


def test_who_stops_a_recipe_sees_no_traceback(monkeypatch, capfd, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["plot.py"])

    def stopped(config):
        raise KeyboardInterrupt

    with pytest.raises(SystemExit) as ended:
        recipe("plot")(stopped)()
    assert ended.value.code == 130 and capfd.readouterr().err.splitlines() == ["", STOPPED]


def test_the_loggers_of_other_libraries_are_left_alone(monkeypatch, tmp_path):
    """Hydra would close their handlers, and one of dm_control's closes the stream that it writes to."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["plot.py"])
    logger, closed = logging.getLogger("somebody"), []
    handler = logging.NullHandler()
    monkeypatch.setattr(handler, "close", lambda: closed.append(handler))
    logger.addHandler(handler)
    recipe("plot")(lambda config: None)()
    assert logger.handlers == [handler] and not logger.disabled and not closed
    logger.removeHandler(handler)


def test_with_a_full_error_everything_is_raised(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(FULL_ERROR, "1")
    monkeypatch.setattr(sys, "argv", ["plot.py", "seed=-5"])
    with pytest.raises(UserError, match="seed must be"):
        recipe("plot")(lambda config: None)()
    assert os.environ[FULL_ERROR] == "1"


def test_a_recipe_without_values_is_told_where_they_belong(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["mine.py"])
    with pytest.raises(
        SystemExit, match=r"the recipe mine needs a file of its values, .*/configs/recipe/mine.yaml"
    ):
        recipe("mine")(lambda config: None)()
    monkeypatch.setattr("tstar_rl.config.load.CONFIGS", tmp_path / "configs")
    with pytest.raises(SystemExit, match=r"a recipe needs a clone, .*there is no .*configs"):
        recipe("mine")(lambda config: None)()


def test_as_a_user_sees_it(tmp_path):
    variables = {name: value for name, value in environ().items() if name != FULL_ERROR}
    called = command("gail_ppo", "subtask=-1")
    done = subprocess.run(called, env=variables, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 1 and not done.stdout
    first, second = done.stderr.splitlines()
    assert first.startswith("subtask of table_lack must be") and second == HINT


def test_the_help_says_what_a_recipe_does_and_which_files_and_values_it_has():
    called = command("spirl", "--help")
    said = subprocess.run(called, env=environ(), capture_output=True, text=True, check=True).stdout
    assert (
        said.startswith("SPiRL: ") and "\n  spirl=<gpu, laptop, paper" in said and "\nsystem: spirl\n" in said
    )
    assert "experiment=" not in said and "Hydra" not in said  # it chooses no experiment


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_reader_of_the_help_may_stop_early(unbuffered):
    process = subprocess.Popen(
        command("bc", "--help"),
        env=environ() | {"PYTHONUNBUFFERED": unbuffered},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    process.stdout.close()  # before a word of it
    assert process.stderr.read() == "" and process.wait() == 0


def test_a_recipe_of_another_checkout_does_not_run_with_this_ones_code(tmp_path):
    (tmp_path / "recipes").mkdir()
    copy = tmp_path / "recipes" / "bc.py"
    copy.write_text(Path(command("bc")[1]).read_text())
    package = tmp_path / "tstar_rl"
    (package / "tstar_rl").mkdir(parents=True)  # a clone beside a user's own folder of recipes

    def help_of_copy() -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, str(copy), "--help"], capture_output=True, text=True, env=environ()
        )

    assert help_of_copy().returncode == 0
    (package / "__init__.py").write_text("")
    found = help_of_copy()
    assert found.returncode == 1 and "Traceback" not in found.stderr
    assert f"would run with the code of {Path(__file__).parents[2]}" in found.stderr
    assert f"PYTHONPATH={tmp_path}:{tmp_path}/envs" in found.stderr
