"""Behaviour cloning of one subtask, or of the whole task.

python recipes/bc.py task=table_lack subtask=0
"""

from omegaconf import DictConfig

import tstar_rl as rl
from tstar_rl.runs.mismatch import NOT_CLONED


@rl.recipe("bc")
def main(config: DictConfig) -> None:
    """Trains, logs and saves."""
    skill = rl.new_skill(config, config.subtask)
    expert = rl.load_demonstrations(config, config.subtask)
    run = rl.Run(rl.plain(config), config.subtask, unread=NOT_CLONED)
    run.start(skill=skill)
    skill.normalizer.fit(expert.observations, config.normalizer.floor)
    cloning = rl.settings(rl.BehaviourCloningSettings, config.bc)
    seed = rl.derive_seed(config.seed, "updates")
    run.log(0, **rl.behaviour_cloning(skill.policy, expert.observations, expert.actions, cloning, seed))
    skill.save(run.work / "last", **run.origin)
    run.finish()


if __name__ == "__main__":
    main()
