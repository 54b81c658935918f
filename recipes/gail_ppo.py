"""GAIL + PPO: one skill from the environment's reward and an imitation reward (the paper's first stage).

python recipes/gail_ppo.py task=table_lack subtask=0 scale=laptop seed=0
"""

from omegaconf import DictConfig

import tstar_rl as rl


@rl.recipe("gail_ppo")
def main(config: DictConfig) -> None:
    """Algorithm 1, first loop, for one subtask or for the whole task."""
    training = rl.skill_training(config)
    f_phi = training.skill.f_phi
    update_f_phi = training.discriminator_update(
        "f_phi", training.skill, rl.settings(rl.DiscriminatorSettings, config.f_phi), expert=1.0, agent=-1.0
    )
    update_policy = training.policy_update()
    reward = rl.weighted(rl.settings(rl.RewardMixture, config.reward), {"gail": rl.GAILReward(f_phi)})

    for rollout in training.rollouts():
        log = update_f_phi(expert=training.expert.observations, agent=rollout["observation"])
        log |= update_policy(reward(rollout), training.progress)
        training.log(rollout, log)


if __name__ == "__main__":
    main()
