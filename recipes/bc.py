"""Behaviour cloning of one subtask, or of the whole task.

python recipes/bc.py task=table_lack subtask=0
"""

from omegaconf import DictConfig

from tstar_rl.config import load_demonstrations, new_skill, plain, recipe, settings
from tstar_rl.runs.run import Run
from tstar_rl.seeds import derive_seed
from tstar_rl.updates import BehaviourCloningSettings, behaviour_cloning


@recipe("bc")
def main(config: DictConfig) -> None:
    """Trains, logs and saves."""
    run, skill = Run(plain(config), config.subtask), new_skill(config, config.subtask)
    expert = load_demonstrations(config, config.subtask)
    run.start(skill=skill)
    skill.normalizer.fit(expert.observations, config.normalizer.floor)
    cloning, seed = settings(BehaviourCloningSettings, config.bc), derive_seed(config.seed, "updates")
    run.log(0, **behaviour_cloning(skill.policy, expert.observations, expert.actions, cloning, seed))
    skill.save(run.work / "last", recipe=config.system)
    run.finish()


if __name__ == "__main__":
    main()
