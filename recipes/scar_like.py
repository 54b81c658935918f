"""SCaR-like: T-STAR with a discriminator that is trained on both sides of a skill.

    python recipes/scar_like.py task=table_lack scale=laptop seed=0

After what is known of SCaR (Chen et al. 2024), whose text and code were not at hand: this is not SCaR. One
discriminator a skill tells initiation sets (1) from termination sets (0) at the seam with the skill before and at that
with the next skill, each with weight .5. It pays the skill's successes. Control: `tstar.py`: the second seam alone,
whose d_omega is the next skill's and reads states through its normaliser; this one is the skill's own.
"""

from omegaconf import DictConfig

import tstar_rl as rl


@rl.recipe("scar_like", from_checkpoint=str)
def main(config: DictConfig) -> None:
    """As T-STAR, with d_seams in the place of d_omega."""
    f_phi, d_seams = (rl.settings(rl.DiscriminatorSettings, config[name]) for name in ("f_phi", "d_omega"))
    for turn in rl.chain_turns(config):
        skill, pays = turn.skill, turn.following is not None  # nothing comes after the last skill
        update_policy = turn.policy_update()
        update_f_phi = turn.discriminator_update("f_phi", skill, f_phi, expert=1.0, agent=-1.0)
        update_d_seams = turn.discriminator_update("d_seams", skill, d_seams, initiation=1.0, termination=0.0)
        terms = {"gail": rl.GAILReward(skill.f_phi)}
        if pays:
            d = turn.once_learned("d_seams", skill)
            terms["tsr"] = rl.TerminalStateReward(d, **config.terminal_reward)
        reward = rl.weighted(rl.settings(rl.RewardMixture, config.reward), terms)

        for rollout in turn.rollouts():
            skill.initiation_set.extend_from(rollout)  # I_i and beta_i grow
            skill.termination_set.extend_from(turn.chained(rollout))
            log = update_f_phi(expert=turn.expert.observations, agent=rollout["observation"])
            log |= update_d_seams.on_sides([seam.states() for seam in turn.seams], weight=0.5)
            if pays and update_d_seams.has_learned:
                turn.signal("d_seams", terms["tsr"])
            log |= update_policy(reward(rollout), turn.progress)
            turn.log(rollout, log)


if __name__ == "__main__":
    main()
