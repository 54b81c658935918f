"""GAIL: one policy, of a subtask or of the whole task, from the imitation reward alone.

python recipes/gail.py task=table_lack scale=whole seed=0          # or subtask=0 scale=laptop
"""

from omegaconf import DictConfig

import tstar_rl as rl


@rl.recipe("gail")
def main(config: DictConfig) -> None:
    """As GAIL + PPO, less the environment's reward: its weight is 0 in configs/recipe/gail.yaml."""
    training = rl.skill_training(config)
    discriminator = rl.settings(rl.DiscriminatorSettings, config.f_phi)
    update_f_phi = training.discriminator_update(
        "f_phi", training.skill, discriminator, expert=1.0, agent=-1.0
    )
    update_policy = training.policy_update()
    reward = rl.weighted(
        rl.settings(rl.RewardMixture, config.reward), {"gail": rl.GAILReward(training.skill.f_phi)}
    )

    for rollout in training.rollouts():
        log = update_f_phi(expert=training.expert.observations, agent=rollout["observation"])
        training.log(rollout, log | update_policy(reward(rollout), training.progress))


if __name__ == "__main__":
    main()
