"""Hand-over value: pays a skill what the next skill's critic expects from the state that it hands over.

    python recipes/hand_over_value.py task=table_lack scale=laptop seed=0

The critic counts only as far as it is sure: (1 - min(alpha A^2, 1)) V, with A its temporal difference error. That error
is seen in the next skill's own turns, in the first step of every episode, where a small network learns it. Until such a
turn was kept it is not known, and the critic is trusted; `chain.order=backward` begins with the last skill. V counts in
units of its mean over the states from which the next skill has succeeded; nothing is paid while there is no such mean.
Control: `policy_sequencing.py` with the constant bonus that this paid on average, on the same chain.starts.
"""

from omegaconf import DictConfig

import tstar_rl as rl


@rl.recipe(
    "hand_over_value",
    alpha=float,
    value_scale=float | None,
    value_error=rl.Section,
    from_checkpoint=str,
)
def main(config: DictConfig) -> None:
    """As T-STAR, with the next skill's critic in the place of d_omega."""
    f_phi = rl.settings(rl.DiscriminatorSettings, config.f_phi)
    mixture = rl.settings(rl.RewardMixture, config.reward)
    learning = rl.settings(rl.LabelledSettings, config.value_error)
    for turn in rl.chain_turns(config):
        skill, following, signal = turn.skill, turn.following, None
        update_policy = turn.policy_update()
        update_f_phi = turn.discriminator_update("f_phi", skill, f_phi, expert=1.0, agent=-1.0)
        update_error = turn.labelled_update("value_error", skill, rl.squared_error_loss, learning)
        scale = rl.value_scale(following, config.value_scale) if following else None
        if following and not scale:
            print(
                f"skill {following.subtask}: its critic has no unit yet, so skill {skill.subtask} is paid nothing"
            )
        if following and scale:
            error = turn.learned("value_error", following)
            signal = rl.HandOverValueReward(
                rl.StateValue(following), error, config.alpha, scale, **config.terminal_reward
            )
            turn.signal("hand_over_value", signal)
        reward = rl.weighted(mixture, {"gail": rl.GAILReward(skill.f_phi), "tsr": signal})

        for rollout in turn.rollouts():
            skill.initiation_set.extend_from(rollout)  # its critic's mean there is what counts as 1
            skill.termination_set.extend_from(turn.chained(rollout))
            log = update_f_phi(expert=turn.expert.observations, agent=rollout["observation"])
            rollout, own = reward(rollout), rl.value_scale(skill, config.value_scale)
            # Before the critic is fitted to this rollout.
            errors = turn.critic_errors(rollout, own) if own else None
            log |= update_policy(rollout, turn.progress)
            if errors:
                log |= update_error(*errors)
            turn.log(rollout, log)


if __name__ == "__main__":
    main()
