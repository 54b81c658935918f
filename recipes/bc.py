"""Behaviour cloning of one subtask, or of the whole task.

python recipes/bc.py task=table_lack subtask=0
"""

from omegaconf import DictConfig

from tstar_rl.config.build import load_demonstrations, new_skill
from tstar_rl.config.load import plain, recipe, settings
from tstar_rl.runs.run import Run
from tstar_rl.seeds import derive_seed
from tstar_rl.updates import BehaviourCloningSettings, behaviour_cloning


@recipe("bc")
def main(config: DictConfig) -> None:
    """Trains, logs and saves."""
    run = Run(plain(config), config.subtask)
    skill = new_skill(config, config.subtask)
    expert = load_demonstrations(config, config.subtask)
    run.start(skill=skill)
    skill.normalizer.fit(expert.observations, config.normalizer.floor)
    seed = derive_seed(config.seed, "updates")
    log = behaviour_cloning(
        skill.policy,
        expert.observations,
        expert.actions,
        settings(BehaviourCloningSettings, config.bc),
        seed,
    )
    run.log(0, **log)
    skill.save(run.work / "last", recipe=config.system)
    run.finish()


if __name__ == "__main__":
    main()
