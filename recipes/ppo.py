"""PPO: one policy, of a subtask or of the whole task, from the environment's reward alone.

python recipes/ppo.py task=table_lack scale=whole seed=0          # or subtask=0 scale=laptop
"""

import torch
from omegaconf import DictConfig

from tstar_rl.config.build import explore, load_demonstrations, make_collection, new_skill
from tstar_rl.config.load import plain, recipe, settings
from tstar_rl.rollouts.collection import rollout_metrics
from tstar_rl.runs.run import Run
from tstar_rl.seeds import derive_seed
from tstar_rl.transforms import RewardMixture
from tstar_rl.updates import (
    BehaviourCloningSettings,
    PolicyUpdate,
    PPOSettings,
    behaviour_cloning,
)


@recipe("ppo")
def main(config: DictConfig) -> None:
    """Rolls out and updates; demonstrations serve the normaliser, and the warm start if there is one."""
    total, training = config.training.total_steps, config.training
    run = Run(plain(config), config.subtask, total)
    seed = derive_seed(config.seed, "train", config.subtask)
    skill = new_skill(config, config.subtask)
    expert = load_demonstrations(config, config.subtask)
    skill.normalizer.fit(expert.observations, config.normalizer.floor)
    update_policy = PolicyUpdate(
        skill.policy,
        skill.value,
        settings(PPOSettings, config.ppo),
        skill.return_scale,
        seed,
    )
    reward = RewardMixture(**{**config.reward, "lambda_2": 0.0, "lambda_3": 0.0})
    collection = make_collection(config, skill.policy, config.subtask, seed)
    steps = run.start(
        skill=skill,
        collection=collection,
        update_policy=update_policy,
    )
    if steps == 0 and config.warm_start:
        cloning = settings(BehaviourCloningSettings, config.bc)
        behaviour_cloning(skill.policy, expert.observations, expert.actions, cloning, seed)
        torch.manual_seed(seed)

    while steps < total:
        explore(skill, config, steps / total)
        rollout = collection.rollout()
        steps += rollout.numel()
        rollout = reward(rollout)
        log = update_policy(rollout, steps / total) | collection.counts()
        if config.normalizer.running:
            skill.normalizer.update(rollout["observation"], config.normalizer.floor)
        run.log(steps, **rollout_metrics(rollout), **log)
        if run.improved:
            skill.save(run.work / "best", recipe=config.system, env_steps=steps)
        run.save_if_due(training.checkpoint_every)

    collection.close()
    skill.save(run.work / "last", recipe=config.system, env_steps=steps)
    run.finish()


if __name__ == "__main__":
    main()
