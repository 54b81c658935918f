"""Policy Sequencing: fine-tunes trained skills on starts like those that the skill before leaves.

    python recipes/policy_sequencing.py task=table_lack scale=laptop seed=0

With `bonus=0.45 system=policy_sequencing_bonus` every success is paid lambda_3 times that number: what T-STAR's
terminal reward would do if its discriminator told nothing apart.
"""

from functools import partial

import torch
from omegaconf import DictConfig
from torchrl.envs import Compose

from tstar_rl.chaining.chain import TurnEnd, chain_progress, save_chain, seed_sets, terminal_poses
from tstar_rl.config.build import (
    chain_trial_environment,
    explore,
    load_demonstrations,
    load_skills,
    make_collection,
    trial_environment,
)
from tstar_rl.config.load import plain, recipe, settings
from tstar_rl.rollouts.collection import rollout_metrics
from tstar_rl.runs.run import Run
from tstar_rl.seeds import derive_seed
from tstar_rl.transforms import ConstantBonus, GAILReward, RewardMixture, TerminalStateReward
from tstar_rl.updates import DiscriminatorSettings, PolicyUpdate, PPOSettings, make_f_phi_update


@recipe("policy_sequencing", bonus=float | None, from_checkpoint=str)
def main(config: DictConfig) -> None:
    """Algorithm 1, lines 8 to 18, less what is red in it. A turn trains one skill; the others stand still."""
    skills = load_skills(config, checkpoint=config.from_checkpoint)
    experts = [load_demonstrations(config, index) for index in range(len(skills))]
    turns, training = config.chain.rounds * len(skills), config.training
    frames = training.num_envs * training.horizon
    rollouts = max(config.chain.steps_per_turn // frames, 1)
    run = Run(plain(config), None, turns * rollouts * frames, trials=True)
    steps = run.start(**{f"skill{index}": skill for index, skill in enumerate(skills)})

    chain = config.chain
    end_turn = TurnEnd(
        lambda: chain_progress(skills, chain_trial_environment(config)),
        chain.gate, chain.gate_on, chain.gate_margin, chain.whole_trial_every,
    )  # fmt: skip
    if run.turn == 0:
        seed_sets(skills, partial(trial_environment, config, skills, 0))

    while run.turn < turns:
        index, seed = run.turn % len(skills), derive_seed(config.seed, "train", run.turn)
        torch.manual_seed(seed)
        skill, before = skills[index], skills[index].network_state()
        starts = skills[index - 1].termination_set if index else None  # 80% a Gaussian fitted to it
        collection = make_collection(config, skill.policy, index, seed, starts, snapshots=True)
        update_f_phi = make_f_phi_update(skill.f_phi, settings(DiscriminatorSettings, config.f_phi), seed)
        ppo = settings(PPOSettings, {**config.ppo, **config.chain.ppo})
        update_policy = PolicyUpdate(skill.policy, skill.value, ppo, skill.return_scale, seed)
        reward = [GAILReward(skill.f_phi)]
        weights = {**config.reward, "lambda_3": 0.0}
        if config.bonus is not None and index + 1 < len(skills):
            reward.append(TerminalStateReward(ConstantBonus(config.bonus)))
            weights["lambda_3"] = config.reward.lambda_3
        reward = Compose(*reward, RewardMixture(**weights))

        for number in range(rollouts):
            explore(skill, config, 1.0)
            rollout = collection.rollout()
            steps += rollout.numel()
            skill.termination_set.extend_from(rollout)
            if index == config.chain.logged_skill:
                run.log_terminal_states(steps, index, terminal_poses(rollout, config.chain.logged_states))
            log = update_f_phi(experts[index].observations, rollout["observation"])
            rollout = reward(rollout)
            log |= update_policy(rollout, steps / run.total) | collection.counts()
            if config.normalizer.running:
                skill.normalizer.update(rollout["observation"], config.normalizer.floor)
            if number == rollouts - 1:
                make_trial = partial(trial_environment, config, skills, run.turn + 1, index)
                log |= end_turn(skill, before, make_trial, run.turn)
            run.log(steps, skill=index, round=run.turn // len(skills), **rollout_metrics(rollout), **log)
            if run.improved:
                save_chain(skills, run.work / "best", recipe=config.system, env_steps=steps)
        collection.close()
        run.turn += 1
        run.save_if_due(0)

    save_chain(skills, run.work / "last", recipe=config.system, env_steps=steps)
    run.finish()


if __name__ == "__main__":
    main()
