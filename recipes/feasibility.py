"""Feasibility: pays a skill what a classifier of the next skill's outcomes says of the state that it hands over.

    python recipes/feasibility.py task=table_lack scale=laptop seed=0
    python recipes/feasibility.py label=share system=feasibility_share seed=0
    python recipes/feasibility.py hard_starts=0.5 reward.weights.tsr=0 system=hard_starts seed=0  # pays nothing

F learns from starts of the next skill and what came of them, failures too: all of those in trials of the chain, and
the chained ones of the next skill's own turns (with chain.kept_states=all, all). Before the first of them it pays
nothing. Its label is whether the next skill succeeded, or the share of the rest of the chain that was then done. With
hard_starts, that share of chained starts is drawn where another classifier, of the skill's own outcomes, expects it to
fail; it learns in the skill's own turn, so those before the first update are drawn uniformly. Control:
`policy_sequencing.py` with the constant bonus that F paid on average, on the same chain.starts.
"""

from omegaconf import DictConfig

import tstar_rl as rl


@rl.recipe("feasibility", label=rl.Label, hard_starts=float, feasibility=rl.Section, from_checkpoint=str)
def main(config: DictConfig) -> None:
    """As T-STAR, with F in the place of d_omega."""
    f_phi = rl.settings(rl.DiscriminatorSettings, config.f_phi)
    learning = rl.settings(rl.LabelledSettings, config.feasibility)
    mixture = rl.settings(rl.RewardMixture, config.reward)
    for turn in rl.chain_turns(config):
        skill, following, f = turn.skill, turn.following, None
        update_policy = turn.policy_update()
        update_f_phi = turn.discriminator_update("f_phi", skill, f_phi, expert=1.0, agent=-1.0)
        if config.hard_starts:
            update_own = turn.labelled_update("own_feasibility", skill, rl.outcome_loss, learning)
            own = rl.FeasibilityReward(skill.network("own_feasibility"))
        if following:
            update_f = turn.labelled_update("feasibility", following, rl.outcome_loss, learning)
            f = rl.FeasibilityReward(following.network("feasibility"), **config.terminal_reward)
        gail = rl.GAILReward(skill.f_phi)
        reward, later = rl.weighted(mixture, {"gail": gail, "tsr": None}), None
        reward_with_f = rl.weighted(mixture, {"gail": gail, "tsr": f})

        for rollout in turn.rollouts():
            skill.termination_set.extend_from(turn.chained(rollout))
            log = update_f_phi(expert=turn.expert.observations, agent=rollout["observation"])
            if following and f is not None:
                log |= update_f(following.outcomes.observations(), following.outcomes.labels(config.label))
                if update_f.has_learned:
                    reward, later = reward_with_f, turn.signal("feasibility", f, config.label).said
            skill.outcomes.add(*turn.outcomes(rollout, later))
            if config.hard_starts:
                log |= update_own(skill.outcomes.observations(), skill.outcomes.labels("success"))
                if update_own.has_learned:
                    turn.begin_where_it_fails(own.said, config.hard_starts)
            log |= update_policy(reward(rollout), turn.progress)
            turn.log(rollout, log)


if __name__ == "__main__":
    main()
