"""Policy Sequencing: fine-tunes trained skills on starts like those that the skill before leaves.

    python recipes/policy_sequencing.py task=table_lack scale=laptop seed=0

With `bonus=0.45 system=policy_sequencing_bonus` every success but the last skill's is paid the weight of the terminal
reward times that number. With T-STAR's starts too, `"chain.starts={environment: 0.2, gaussian: 0.0, buffer: 0.8}"`,
that is what T-STAR would do if its discriminator said the same of every state: its control.
"""

from omegaconf import DictConfig

import tstar_rl as rl


@rl.recipe("policy_sequencing", bonus=float | None, from_checkpoint=str)
def main(config: DictConfig) -> None:
    """Algorithm 1, second loop, less D_omega and its reward (GAIL stays: appendix C); starts as chain.starts says."""
    f_phi = rl.settings(rl.DiscriminatorSettings, config.f_phi)
    for turn in rl.chain_turns(config):
        update_policy = turn.policy_update()
        update_f_phi = turn.discriminator_update("f_phi", turn.skill, f_phi, expert=1.0, agent=-1.0)
        terms = {"gail": rl.GAILReward(turn.skill.f_phi)}
        if config.bonus is not None and turn.following:
            terms["tsr"] = rl.TerminalStateReward(rl.ConstantBonus(config.bonus))
        reward = rl.weighted(rl.settings(rl.RewardMixture, config.reward), terms)

        for rollout in turn.rollouts():
            turn.skill.termination_set.extend_from(turn.chained(rollout))
            log = update_f_phi(expert=turn.expert.observations, agent=rollout["observation"])
            log |= update_policy(reward(rollout), turn.progress)
            turn.log(rollout, log)


if __name__ == "__main__":
    main()
