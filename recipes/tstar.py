"""T-STAR: fine-tunes trained skills so that each ends where the next can start.

python recipes/tstar.py task=table_lack scale=laptop seed=0
"""

from omegaconf import DictConfig

import tstar_rl as rl


@rl.recipe("tstar", from_checkpoint=str)
def main(config: DictConfig) -> None:
    """Algorithm 1, second loop: each turn trains one skill, the others stand still."""
    f_phi, d_omega = (rl.settings(rl.DiscriminatorSettings, config[name]) for name in ("f_phi", "d_omega"))
    for turn in rl.chain_turns(config):
        skill, following = turn.skill, turn.following  # None after the last skill
        update_policy = turn.policy_update()
        update_f_phi = turn.discriminator_update("f_phi", skill, f_phi, expert=1.0, agent=-1.0)
        terms = {"gail": rl.GAILReward(skill.f_phi)}
        if turn.seam:
            update_d_omega = turn.discriminator_update(
                "d_omega", turn.seam.after, d_omega, initiation=1.0, termination=0.0
            )
        if following:
            d = turn.once_learned("d_omega", following)
            terms["tsr"] = rl.TerminalStateReward(d, **config.terminal_reward)
        reward = rl.weighted(rl.settings(rl.RewardMixture, config.reward), terms)

        for rollout in turn.rollouts():
            skill.initiation_set.extend_from(rollout)  # I_i and beta_i grow
            skill.termination_set.extend_from(turn.chained(rollout))
            log = update_f_phi(expert=turn.expert.observations, agent=rollout["observation"])
            if turn.seam:
                # I of the skill after the seam, beta of the one before it
                log |= update_d_omega(**turn.seam.states())
            log |= update_policy(reward(rollout), turn.progress)
            turn.log(rollout, log)


if __name__ == "__main__":
    main()
