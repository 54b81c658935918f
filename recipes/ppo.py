"""PPO: one policy, of a subtask or of the whole task, from the environment's reward alone.

python recipes/ppo.py task=table_lack scale=whole seed=0          # or subtask=0 scale=laptop
"""

from omegaconf import DictConfig

import tstar_rl as rl


@rl.recipe("ppo")
def main(config: DictConfig) -> None:
    """Rolls out and updates; demonstrations serve the normaliser, and the warm start if there is one."""
    training = rl.skill_training(config)
    update_policy = training.policy_update()
    reward = rl.weighted(rl.settings(rl.RewardMixture, config.reward), {})

    for rollout in training.rollouts():
        training.log(rollout, update_policy(reward(rollout), training.progress))


if __name__ == "__main__":
    main()
