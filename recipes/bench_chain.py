"""The part of the bench that chains: one turn of every skill by `tstar.py`, and the bare simulator beside it."""

import time
from collections.abc import Sequence
from pathlib import Path
from statistics import harmonic_mean
from tempfile import TemporaryDirectory

from bench_bare import Replay, replay
from bench_training import cloned
from hydra import compose
from make_demonstrations import main as make_demonstrations
from omegaconf import DictConfig
from tstar import main as tstar

from tstar_rl.chaining.skill import Skill
from tstar_rl.config.build import environment, load_demonstrations
from tstar_rl.config.ranges import chain_length, turn_shape
from tstar_rl.runs.run_folder import run_path
from tstar_rl.seeds import derive_seed


def chain_rates(given: Sequence[str], rounds: int, steps: int) -> dict[str, float]:
    """Environment steps a second that a chain learns from, and that the bare simulator does.

    `chain`: those that the skills learn from, over the time from the call of `tstar.py` to its end: it loads the
    skills, fills the sets, trains each skill `rounds` times, tries the chain after each turn, saves. `bare_chain` is
    the bare simulator under the skills' policies, as many steps of each, measured before the chain and after it: the
    higher counts, since a chain can take long and other work on the machine comes and goes.

    The skills are clones of demonstrations, as training begins: a chain of trained ones gets further, and its trials
    take longer.

    Args:
        given: values for `tstar.py` that were given on the command line.
        rounds: turns of each skill.
        steps: control steps of each simulation and skill, bare.
    """
    with TemporaryDirectory() as folder:
        places = [f"{name}_dir={folder}/{name}" for name in ("results", "runs", "demonstrations")]
        own = [*given, *places, f"chain.rounds={rounds}", "progress_bar=false"]
        config = compose("recipe/tstar", own)
        make_demonstrations(
            compose("recipe/make_demonstrations", [*own, f"kinds=[{config.demonstrations.kind}]"])
        )
        skills = [_saved(config, index) for index in range(chain_length(config))]
        told = [_told(config, skill, steps) for skill in skills]
        before = _bare(config, told)
        began = time.perf_counter()
        tstar(config)
        spent = time.perf_counter() - began
        bare = max(before, _bare(config, told))
        return {"bare_chain": bare, "chain": _learned_from(config, len(skills)) / spent}


def _saved(config: DictConfig, index: int) -> Skill:
    """The clone of a subtask's demonstrations, where `tstar.py` looks for a skill."""
    skill = cloned(
        config, index, load_demonstrations(config, index), derive_seed(config.seed, "train", index)
    )
    path = run_path(config.runs_dir, config.task.name, config.skills, config.seed, index)
    skill.save(Path(path) / config.from_checkpoint, recipe=config.skills, env_steps=0)
    return skill


def _told(config: DictConfig, skill: Skill, steps: int) -> Replay:
    """What the simulator is told by a skill's policy."""
    training = config.training
    seed = derive_seed(config.seed, "train", skill.subtask)
    env = environment(config, skill.subtask, training.num_envs, seed, max_steps=training.max_steps)
    return replay(env, skill.policy, steps)


def _bare(config: DictConfig, told: Sequence[Replay]) -> float:
    """Control steps a second of the bare simulator, as many for each skill."""
    return harmonic_mean([each.rate(config.nthread) for each in told])


def _learned_from(config: DictConfig, skills: int) -> int:
    """Environment steps in the rollouts of all turns."""
    rollouts, frames = turn_shape(config)
    return config.chain.rounds * skills * rollouts * frames
