"""From a config to a chain's skills and to simulations of one subtask that begin at a seam."""

from omegaconf import DictConfig
from torchrl.envs import TransformedEnv

from tstar_rl.chaining.chain import load_chain
from tstar_rl.chaining.skill import Skill
from tstar_rl.config.build import environment
from tstar_rl.config.chain import check_links, skills_as_they_are
from tstar_rl.config.recovery import refuse_recovery
from tstar_rl.config.worlds import check_world
from tstar_rl.rollouts.state_sets import TerminationSet
from tstar_rl.runs.run_folder import is_untrained, run_path

__all__ = ["chain_of", "env_at_seam"]


def chain_of(config: DictConfig, system: str) -> list[Skill]:
    """The skills of a system at config.checkpoint, in order.

    Raises:
        ConfigError: if chain.links is not how many a trained chain has.
        InvalidValueError: if it is a chain with recovery.
        CheckpointMismatchError: if it was trained in another world; see `check_world`.
    """
    if is_untrained(system):
        return skills_as_they_are(config, config.checkpoint)
    run = run_path(config.runs_dir, config.task.name, system, config.seed)
    refuse_recovery(run / config.checkpoint / "skill0")
    check_world(config, run / config.checkpoint / "skill0")
    skills = load_chain(run / config.checkpoint, task=config.task.name)
    check_links(config, len(skills))
    return [skill.to(config.device) for skill in skills]


def env_at_seam(
    config: DictConfig, seed: int, subtask: int, number: int, starts: TerminationSet | None
) -> TransformedEnv:
    """Simulations of a subtask that all begin in `starts`, with snapshots; None: the environment's own starts."""
    return environment(config, subtask, number, seed, starts, snapshots=True, shares={"buffer": 1.0})
