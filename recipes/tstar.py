"""T-STAR: fine-tunes trained skills so that each ends where the next can start.

python recipes/tstar.py task=table_lack scale=laptop seed=0
"""

from functools import partial

import torch
from omegaconf import DictConfig
from torchrl.envs import Compose

from tstar_rl.chaining.chain import TurnEnd, chain_progress, save_chain, seed_sets, states, terminal_poses
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
from tstar_rl.transforms import GAILReward, RewardMixture, TerminalStateReward
from tstar_rl.updates import (
    DiscriminatorSettings,
    PolicyUpdate,
    PPOSettings,
    make_d_omega_update,
    make_f_phi_update,
)


@recipe("tstar", from_checkpoint=str)
def main(config: DictConfig) -> None:
    """Algorithm 1, lines 8 to 18. A turn trains one skill; the others stand still."""
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
        following = skills[index + 1] if index + 1 < len(skills) else None
        starts = skills[index - 1].termination_set if index else None  # 80%; 20% the environment's
        collection = make_collection(config, skill.policy, index, seed, starts, snapshots=True)
        update_f_phi = make_f_phi_update(skill.f_phi, settings(DiscriminatorSettings, config.f_phi), seed)
        ppo = settings(PPOSettings, {**config.ppo, **config.chain.ppo})
        update_policy = PolicyUpdate(skill.policy, skill.value, ppo, skill.return_scale, seed)
        reward = [GAILReward(skill.f_phi)]
        weights = dict(config.reward)
        if following is not None:
            update_d_omega = make_d_omega_update(
                following.d_omega, settings(DiscriminatorSettings, config.d_omega), seed
            )
            reward.append(TerminalStateReward(following.d_omega, **config.terminal_reward))
        else:
            weights["lambda_3"] = 0.0  # nothing starts where the last skill ends
        reward = Compose(*reward, RewardMixture(**weights))

        for number in range(rollouts):
            explore(skill, config, 1.0)
            rollout = collection.rollout()
            steps += rollout.numel()
            skill.initiation_set.extend_from(rollout)
            skill.termination_set.extend_from(rollout)
            if index == config.chain.logged_skill:
                run.log_terminal_states(steps, index, terminal_poses(rollout, config.chain.logged_states))
            log = update_f_phi(experts[index].observations, rollout["observation"])
            if following is not None:
                log |= update_d_omega(states(following.initiation_set), states(skill.termination_set))
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
