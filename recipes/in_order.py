"""Skills learned in order: each from demonstrations that begin where the skill before ends, and then from such starts.

    python recipes/bc.py task=table_lack scale=no_return subtask=0     # and 1, 2, 3: what is trained here
    python recipes/in_order.py task=table_lack scale=no_return seed=0

after `make_demonstrations.py`, and in folders of their own: docs/usage.md, "Step by step", has all commands.

Nothing is mended afterwards: the whole training of a skill is its turn. A share `demonstrated_ends` of its
demonstrations is made anew, by the expert, from states in which the skill before succeeded; the clone is fitted to
them and to the rest of the old ones. With demonstrated_ends=0 no demonstration is made.
"""

from omegaconf import DictConfig

import tstar_rl as rl


@rl.recipe("in_order", demonstrated_ends=float, from_checkpoint=str)
def main(config: DictConfig) -> None:
    """Algorithm 1, second loop, in one long turn for each skill, without a bonus."""
    f_phi = rl.settings(rl.DiscriminatorSettings, config.f_phi)
    cloning = rl.settings(rl.BehaviourCloningSettings, config.bc)
    for turn in rl.chain_turns(config):
        turn.clone_from_ends(config.demonstrated_ends, cloning)
        update_policy = turn.policy_update()
        update_f_phi = turn.discriminator_update("f_phi", turn.skill, f_phi, expert=1.0, agent=-1.0)
        terms = {"gail": rl.GAILReward(turn.skill.f_phi)}
        reward = rl.weighted(rl.settings(rl.RewardMixture, config.reward), terms)

        for rollout in turn.rollouts():
            turn.skill.termination_set.extend_from(turn.chained(rollout))
            log = update_f_phi(expert=turn.expert.observations, agent=rollout["observation"])
            log |= update_policy(reward(rollout), turn.progress)
            turn.log(rollout, log)


if __name__ == "__main__":
    main()
