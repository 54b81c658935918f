"""A chain of trained skills whose arm goes home before a skill that is expected to fail. No policy is trained.

    python recipes/recover.py task=table_lack scale=no_return seed=0
    python recipes/recover.py recovery.below=null recovery.patience=60 system=recover_late seed=0  # only waits
    python recipes/evaluate.py system=recover scale=no_return seed=0

of skills of that scale, in folders of their own (docs/usage.md, "Step by step", has such commands).

Where nobody puts the arm home between subtasks, that is what a chain can do of itself, and it costs time. F, a
classifier of each skill's outcomes, learns from one trial of the chain when it is needed. Controls: always
(recovery.below=1), as often but drawn (recovery.blind=true), only once a skill has tried for long (recovery.patience).
"""

from dataclasses import asdict

from omegaconf import DictConfig

import tstar_rl as rl


@rl.recipe("recover", recovery=rl.Section, feasibility=rl.Section, from_checkpoint=str)
def main(config: DictConfig) -> None:
    """Teaches F of every skill but the first what came of one run of the chain, and saves the chain with its rule."""
    recovery = rl.settings(rl.RecoverySettings, config.recovery)
    learning = rl.settings(rl.LabelledSettings, config.feasibility)
    skills, chain = rl.load_skills(config, checkpoint=config.from_checkpoint), config.chain
    seed, trial, steps, shares = rl.derive_seed(config.seed, "harvest"), None, 0, []
    run = rl.Run(rl.plain(config))
    run.start()
    if recovery.asks_f:
        env = rl.environment(config, None, chain.seed_episodes, seed, max_steps=chain.trial_max_steps)
        trial = rl.run_trial(skills, env)
        steps = trial.steps()
    for index, skill in enumerate(skills[1:], start=1):
        log, logit = {}, None
        if trial is not None:
            found, network = trial.skills[index], skill.network("feasibility")
            update = rl.LabelledUpdate("feasibility", network, rl.outcome_loss, learning, seed)
            log = {"next_success": found.success, **update(found.starts, found.succeeded)}
            logit = network(found.starts)
        shares.append(recovery.share_of(logit))
        run.log(steps, skill=index, asked=shares[-1], **log)
    made = {"recipe": config.system, "env_steps": steps}
    rl.save_chain(
        skills, run.work / "last", **made, recovery={"settings": asdict(recovery), "shares": shares}
    )
    run.finish()


if __name__ == "__main__":
    main()
