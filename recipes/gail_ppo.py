"""GAIL + PPO: one skill from the environment's reward and an imitation reward (the paper's first stage).

python recipes/gail_ppo.py task=table_lack subtask=0 scale=laptop seed=0
"""

from omegaconf import DictConfig

from tstar_rl.config import recipe, settings, skill_training
from tstar_rl.transforms import GAILReward, RewardMixture, weighted
from tstar_rl.updates import DiscriminatorSettings


@recipe("gail_ppo")
def main(config: DictConfig) -> None:
    """Algorithm 1, first loop, for one subtask or for the whole task."""
    training = skill_training(config)
    f_phi = training.skill.f_phi
    update_f_phi = training.discriminator_update(
        "f_phi", training.skill, settings(DiscriminatorSettings, config.f_phi), expert=1.0, agent=-1.0
    )
    update_policy = training.policy_update()
    reward = weighted(settings(RewardMixture, config.reward), {"gail": GAILReward(f_phi)})

    for rollout in training.rollouts():
        log = update_f_phi(expert=training.expert.observations, agent=rollout["observation"])
        log |= update_policy(reward(rollout), training.progress)
        training.log(rollout, log)


if __name__ == "__main__":
    main()
