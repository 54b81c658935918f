"""Proximity: pays every step of a skill for coming nearer to a state from which the next skill succeeds.

    python recipes/proximity.py task=table_lack scale=laptop seed=0

P is 1 in the last state of an episode that was handed over well, decay^k in the k-th state before, 0 in all states of
one that was not. It learns from the trials of the chain, whose episodes alone show what the next skill made of their
end, and from their last chain.path_steps states: before these it is not learned. A step is paid P(s') - P(s), the last
one of a success P(s') more; nothing while there is no trial to learn from. Control: `policy_sequencing.py` on the same
starts.
"""

from omegaconf import DictConfig

import tstar_rl as rl


@rl.recipe("proximity", decay=float, proximity=rl.Section, from_checkpoint=str)
def main(config: DictConfig) -> None:
    """As T-STAR, with a dense reward along the episode in the place of one at its end."""
    if config.chain.path_steps < 1:
        raise rl.InvalidValueError(
            f"P learns from the ends of episodes: chain.path_steps must be at least 1, got {config.chain.path_steps}"
        )
    f_phi = rl.settings(rl.DiscriminatorSettings, config.f_phi)
    mixture = rl.settings(rl.RewardMixture, config.reward)
    learning = rl.settings(rl.LabelledSettings, config.proximity)
    for turn in rl.chain_turns(config):
        following, p = turn.following, None
        update_policy = turn.policy_update()
        update_f_phi = turn.discriminator_update("f_phi", turn.skill, f_phi, expert=1.0, agent=-1.0)
        if following:
            update_p = turn.labelled_update("proximity", following, rl.squared_error_loss, learning)
            p = rl.ProximityReward(following.network("proximity"))
        gail = rl.GAILReward(turn.skill.f_phi)
        reward = rl.weighted(mixture, {"gail": gail, "proximity": None})
        reward_with_p = rl.weighted(mixture, {"gail": gail, "proximity": p})

        for rollout in turn.rollouts():
            turn.skill.termination_set.extend_from(turn.chained(rollout))
            log = update_f_phi(expert=turn.expert.observations, agent=rollout["observation"])
            if following and p is not None:
                states = following.approaches
                log |= update_p(states.observations(), states.proximities(config.decay))
                if update_p.has_learned:
                    reward = reward_with_p
                    turn.signal("proximity", p)
            log |= update_policy(reward(rollout), turn.progress)
            turn.log(rollout, log)


if __name__ == "__main__":
    main()
