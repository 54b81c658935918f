"""A user's mistake on the command line ends in one or two lines: what was got, what is valid, where it belongs."""

import logging
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from recipe_runs import command, environ

from tstar_rl import checks
from tstar_rl.chaining.skill import NetworkSettings, Skill
from tstar_rl.checks import UserError
from tstar_rl.config.command_line import FULL_ERROR, HINT, STOPPED
from tstar_rl.config.load import recipe
from tstar_rl.runs.run_folder import run_path

SMALL = NetworkSettings(hidden=(16,), std="fixed", discriminator_hidden=(16,))


MISTAKES = [
    # an unknown key
    ("gail_ppo", ["sede=1"], "the config has no sede; it has system, .*; did you mean seed"),
    ("gail_ppo", ["ppo.learning_rat=1"], "ppo has no learning_rat; it has epochs, .*did you mean learning_rate"),
    ("gail_ppo", ["popo.epochs=1"], "the config has no popo; it has system, .*of the recipe gail_ppo"),
    ("gail_ppo", ["scael=laptop"], r"the config of gail_ppo has no scael; did you mean scale\?"),
    ("gail_ppo", ["env.snp=true"], "unknown task setting 'snp' .*did you mean 'snap'"),
    ("gail_ppo", ["env.snap=true"], r"env.snap is valid, but not set in .* of gail_ppo: write \+env.snap=\.\.\."),
    ("gail_ppo", ["bonus=1"], "the config has no bonus; it has .*of the recipe gail_ppo"),
    ("gail_ppo", ["seed.x=1"], r"seed must be a whole number, got \{'x': 1\}"),
    ("gail_ppo", ["+seed=1"], "An item is already at 'seed'. Either remove"),
    ("gail_ppo", ["seed=["], r"cannot read 'seed=\[': write key=value"),
    # an unknown option of a group
    ("gail_ppo", ["task=table_lak"], "task must be one of bench_bjursta, .*configs/task.*did you mean table_lack"),
    ("gail_ppo", ["scale=huge"], "scale=huge: scale must be one of ablation, gpu, laptop"),
    ("ablate", ["ablation=lamda_3"], "ablation must be one of d_omega, .*did you mean lambda_3"),
    ("ablate", ["ablation=[lambda_3,strats]"], "ablation=strats: ablation must be .*did you mean starts"),
    ("ablate", ["ablation=lambda_3", "variants=[zeros]"], "has no variant 'zeros'; it has no_finetuning, zero"),
    # a value that is not valid
    ("gail_ppo", ["seed=one"], "seed must be a whole number, got 'one'"),
    ("gail_ppo", ["seed=-5"], "seed must be a whole number from 0, got -5"),
    ("assemble", ["seeds=[0,-1]"], "seeds must be whole numbers from 0, got -1"),
    ("gail_ppo", ["subtask=-1"], r"subtask of table_lack must be null \(the whole task\) or in 0..3, got -1"),
    ("evaluate", ["subtask=4"], "subtask of table_lack must be .* got 4"),
    ("gail_ppo", ["training.num_envs=0"], "training.num_envs must be a whole number from 1, got 0"),
    ("gail_ppo", ["ppo.epochs=0"], "ppo.epochs must be at least 1, got 0"),
    ("gail_ppo", ["networks.activation=gelu"], "activation must be one of relu, tanh; got 'gelu'"),
    ("gail_ppo", ["env.velocity_scale=2"], r"velocity_scale must be in \(0, 1\], got 2"),
    ("gail_ppo", ["demonstrations.kind=clean"], "demonstrations.kind must be one of plain, noisy; got 'clean'"),
    ("gail_ppo", ["collection.backend=dask"], "collection.backend must be one of local, ray; got 'dask'"),
    ("assemble", ["launch=slurm"], "launch must be one of local, ray; got 'slurm'"),
    ("gail_ppo", ["physics=isaac"], "physics must be one of mujoco, warp, null; got 'isaac'"),
    ("gail_ppo", ["device=cpu:0"], "device must be cpu, cuda or cuda:<number>, got 'cpu:0'"),
    ("proximity", ["decay=1.5"], r"decay must be in \(0, 1\], got 1.5"),
    ("gail_ppo", ["device=mps"], "device must be cpu, cuda or cuda:<number>, got 'mps'"),
    (
        "tstar",
        ["chain.order=costliest", "chain.gate=false", "chain.trial_every=2"],
        "chain.order=costliest needs a trial after every turn: chain.gate=true or chain.trial_every=1, got 2",
    ),
    ("tstar", ["chain.links=5"], r"chain.links must be null or in 2..4 for table_lack, got 5"),
    ("ablate", ["ablation=lambda_3", "chain.links=1"], "chain.links must be null or in 2..4 for table_lack, got 1"),
    ("tstar", ["chain.starts={buffer: 2}"], "shares of starts must .* sum to 1"),
    ("gail_ppo", [], "networks.features needs one subtask: set subtask=0.. or networks.features=false"),
    ("evaluate", ["modes=[best]"], "mode must be one of deterministic, stochastic; got 'best'"),
    ("evaluate", ["path=runs/table_lack/tstar/seed1", "seed=0"], "is of seed=1, but seed=0 is asked for"),
    ("evaluate", ["pretrained=table_lack", "task=table_lack"], "table_lack brings its own task: leave task=... out"),
    ("evaluate", ["pretrained=table_lack", "scale=paper", "subtask=1"], "brings its own scale, subtask"),
    ("evaluate", ["pretrained=table_lac"], "trained chains: 'table_lac'; there are .*did you mean table_lack"),
    ("evaluate", ["pretrained=table_lack/tsta"], "chain of table_lack: 'tsta'; there are .*did you mean tstar"),
    ("watch", ["variants=[tstar,nothing]"], "unknown trained chain of table_lack: 'nothing'; there are tstar"),
    ("tstar", ["terminal_reward.score=after"], "terminal_reward.score must be 'terminal' or 'before', got 'after'"),
    ("tstar", ["terminal_reward.baseline=mean"], "terminal_reward.baseline must be 'none' or .*, got 'mean'"),
    ("tstar", ["+terminal_reward.momentum=0"], r"terminal_reward.momentum must be in \(0, 1\], got 0"),
    ("tstar", ["reward.weights={env: 0, gail: 0, tsr: 0}"], r"\(reward.weights\) is zero: .*; got \{'env': 0.*"),
    ("tstar", ["reward.weights={env: 0, gail: 0, tsr: 1}"], r"weights must pay env or gail: the last .*reward_tsr"),
    ("tstar", ["+reward.scales.foo=1"], "reward.scales has foo, which reward.weights has not; it has env, gail, tsr"),
    ("policy_sequencing", ["bonus=2"], r"bonus must be in \[0, 1\], got 2"),
    ("floored", ["floor=0"], "floor must be positive, got 0"),
    ("gail_ppo", ["normalizer.floor=-1"], "normalizer.floor must be positive, got -1"),
    ("gail_ppo", ["networks.std=learned"], "networks.std must be one of state, fixed; got 'learned'"),
    ("gail_ppo", ["networks.action_std=-1"], "networks.action_std must be positive, got -1"),
    ("gail_ppo", ["networks.discriminator_hidden=[-3]"], r"networks.discriminator_hidden must be sizes .* got \(-3,\)"),
    ("gail_ppo", ["exploration.arm=[-1,0.1]"], "exploration.arm must be positive deviations, got"),
    ("make_demonstrations", ["demonstrations.noise=-1"], "demonstrations.noise must be not negative, got -1"),
    ("tstar", ["chain.rounds=0"], "chain.rounds must be a whole number from 1, got 0"),
    ("tstar", ["subtask=1"], "subtask must be null, got 1: tstar is of the whole task; chain.links takes the first sk"),
    ("baselines", ["subtask=1"], "subtask must be null, got 1: baselines is of the whole task; its steps say which"),
    ("make_demonstrations", ["whole=true", "subtask=0"], "whole=true is of the whole task: subtask must be null, got"),
    ("gail_ppo", ["subtask=0", "+env.max_steps=60"], "env.max_steps is not read in training: .* is training.max_steps"),
    ("tstar", ["+env.max_steps=60"], "the time limit there is training.max_steps and chain.trial_max_steps"),
    ("ppo", ["subtask=0", "reward.weights.gail=0.5"], "weights.gail must be 0 for ppo, .* gail_ppo does; got 0.5"),
    ("proximity", ["reward.weights.tsr=1"], "weights.tsr must be 0 for proximity, .*weights.proximity; got 1"),
    (
        "proximity",
        ["terminal_reward.score=before"],
        "proximity does not read terminal_reward, got terminal_reward.score=before; tstar, scar_like",
    ),
    (
        "policy_sequencing",
        ["bonus=0.5", "terminal_reward.baseline=running_mean"],
        "policy_sequencing does not read terminal_reward, got terminal_reward.baseline=running_mean; tstar",
    ),
    ("tstar", ["chain.path_steps=8"], "chain.path_steps must be 0 for tstar, got 8: .* proximity alone"),
    ("tstar", ["chain.logged_skill=4"], r"chain.logged_skill must be in 0..3 for table_lack, got 4"),
    ("in_order", ["skills=gail_ppo"], "skills must be clones, bc or bc_<...>, got gail_ppo: .* demonstrated_ends=0"),
    ("experiment", ["experiment=shelf", "launch=ray"], "experiment.py runs its recipes here: launch must be local"),
    ("experiment", ["experiment=shelf", "arms=[]"], "arms must name at least one, got none"),
    ("gpu_run", ["device=cpu", "scale=quick"], r"gpu_run.py takes scales=\[...\], .*; leave scale=... out"),
    ("hand_over_gap", ["floors=[0]"], r"floors must be positive, got \[0"),
    ("floored", ["from_checkpoint=bset"], "from_checkpoint must be one of last, best; got 'bset'"),
    ("make_demonstrations", ["kinds=[]"], "kinds must name at least one, got none"),
    ("hand_over", ["systems=[]"], "systems must name at least one, got none"),
    ("assemble", ["seeds=[]"], "seeds must name at least one, got none"),
    ("spirl", ["spirl.num_envs=0"], "spirl.num_envs must be a whole number from 1, got 0"),
    ("spirl", ["spirl.model.decoder=deep"], "spirl.model.decoder must be open_loop or closed_loop, got 'deep'"),
    ("parity", ["episodes=0"], "episodes must be a whole number from 1, got 0"),
    ("experiment", ["experiment=terminal_state_regularisation", "minutes=-1"], "minutes must be positive, got -1"),
    ("experiment", ["experiment=terminal_state_regularisation", "tasks=[table_lak]"],
     "task must be one of .*did you mean table_lack"),
    ("baselines", ["only=[gial]"], "only must name some of bc, .*, got gial; did you mean gail"),
    ("ablate", [], "say which: ablation=<name> or all=true; there are "),
    ("baselines", ["systems.bc=[bcc]"], "recipe must be one of ablate, .*did you mean bc"),
    ("evaluate_shelf", ["tasks=[table_lak]"], "a task must be one of bench_bjursta, .*'table_lak'; did you mean ta"),
    ("evaluate", ["path=runs/table_lack"], "a run lies at <task>/<recipe>/seed<k>"),
    ("watch", ["variants=[tstar]"], "variants must be a list of 2, each text or null, got"),
    ("watch", ["noise=-1"], "noise must be not negative, got -1"),
    ("watch", ["variants=[a,b]", "task=toy_table"], "unknown task with trained chains: 'toy_table'; there are .*lack"),
    # something that is not there
    ("plot", ["task=table_lack"], "no metrics.csv below results/table_lack: train something first"),
    ("ship", [], "no chain at runs/table_lack/tstar/seed0/last: train it first"),
    ("gail_ppo", ["subtask=0"], "no demonstrations at demonstrations/.*recipes/make_demonstrations.py writes them"),
    ("tstar", [], "no checkpoint at runs/.*train it first .*recipes/gail_ppo.py task=table_lack subtask=0 seed=0"),
    ("evaluate", ["system=tstar"], "no skill and no chain at runs/table_lack/tstar/seed0/last or .*/best: train it"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "values", "message"), MISTAKES)
def test_a_mistake_is_told_in_words(say, name, values, message):
    assert re.search(message, say(name, *values))


def test_a_checkpoint_that_belongs_elsewhere_or_is_damaged_is_told_in_words(say):
    place = run_path("runs", "table_lack", "gail_ppo", 0, 0) / "last"
    Skill("table_lack", 1, SMALL).save(place)
    assert re.search("subtask0/last does not belong here: subtask was 1 .*is 0 now", say("tstar"))
    (place / "manifest.json").unlink()
    assert re.search("last is damaged: manifest.json is missing", say("evaluate", f"path={place}"))
    assert re.search("subtask0/last is damaged: manifest.json is missing", say("tstar"))


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


def test_a_reader_of_the_help_may_stop_early():
    process = subprocess.Popen(
        command("bc", "--help"), env=environ(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    process.stdout.close()  # before a word of it
    assert process.stderr.read() == "" and process.wait() == 0


def test_a_recipe_of_another_checkout_does_not_run_with_this_ones_code(tmp_path):
    (tmp_path / "tstar_rl").mkdir()
    (tmp_path / "recipes").mkdir()
    copy = tmp_path / "recipes" / "bc.py"
    copy.write_text(Path(command("bc")[1]).read_text())
    found = subprocess.run(
        [sys.executable, str(copy), "--help"], capture_output=True, text=True, env=environ()
    )
    assert found.returncode == 1 and "Traceback" not in found.stderr
    assert f"would run with the code of {Path(__file__).parents[2]}" in found.stderr
    assert f"PYTHONPATH={tmp_path}:{tmp_path}/envs" in found.stderr
