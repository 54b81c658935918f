"""Skills cloned in order: half of the demonstrations begin where the skill before ends; no reward is learned from.

    python recipes/bc.py task=table_lack scale=no_return subtask=0     # and 1, 2, 3: what is cloned again here
    python recipes/in_order_cloned.py task=table_lack scale=no_return seed=0

after `make_demonstrations.py`, and in folders of their own: docs/usage.md, "Step by step", has all commands.

A turn's rollouts only find the states in which its skill ends, from which the expert begins for the next skill.
"""

from omegaconf import DictConfig

import tstar_rl as rl


@rl.recipe("in_order_cloned", demonstrated_ends=float, from_checkpoint=str)
def main(config: DictConfig) -> None:
    """Algorithm 1, second loop, with cloning in the place of every update."""
    cloning = rl.settings(rl.BehaviourCloningSettings, config.bc)
    for turn in rl.chain_turns(config):
        turn.clone_from_ends(config.demonstrated_ends, cloning)
        for rollout in turn.rollouts():
            turn.skill.termination_set.extend_from(turn.chained(rollout))
            turn.log(rollout, {})


if __name__ == "__main__":
    main()
