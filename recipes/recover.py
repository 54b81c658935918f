"""A chain of trained skills whose arm goes home before a skill that is expected to fail. No policy is trained.

    python recipes/recover.py task=table_lack scale=no_return seed=0
    python recipes/recover.py recovery.at_most=null recovery.patience=120 system=recover_late seed=0  # only waits
    python recipes/evaluate.py system=recover scale=no_return seed=0

of skills of that scale, in folders of their own (docs/usage.md, "Step by step", has such commands).

Where nobody puts the arm home between subtasks, that is what a chain can do of itself, and it costs time. F, a
classifier of each skill's outcomes, learns from one trial of the chain; a skill that this never reached has none, and
the arm goes home. Another trial judges it: AUC, Brier score and, in calibration.csv, its reliability curve. Controls:
always (recovery.at_most=1), the share of each skill's hand-overs that F asks for but drawn (recovery.blind=true), only
once a skill has tried for long (recovery.patience).
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
    if recovery.uses_f and chain.seed_episodes < 1:
        raise rl.InvalidValueError(
            "F learns from a run of the chain: chain.seed_episodes must be at least 1, got 0"
        )
    run = rl.chain_run(config, len(skills))
    run.start()
    heard = fresh = None
    if recovery.uses_f:
        heard = rl.run_trial(skills, rl.trial_env(config, chain.seed_episodes, "harvest"))
        fresh = rl.run_trial(skills, rl.trial_env(config, chain.trial_episodes, "validate"))
    steps, seed, shares = heard.steps() if heard else 0, rl.derive_seed(config.seed, "harvest"), []
    for index, skill in enumerate(skills[1:], start=1):
        log, logit = {"trial_steps": fresh.steps() if index == 1 else 0} if fresh else {}, None
        if heard and fresh and len(starts := heard.skills[index].starts):
            log |= rl.learn_outcomes(skill, starts, heard.skills[index].succeeded, learning, seed)
            logit = skill.network("feasibility")(starts)
            judged, curve = rl.judge_outcomes(skill, fresh.skills[index])
            log |= judged
            if curve is not None:
                run.tables.calibration.extend(rl.calibration_rows(steps, index - 1, "feasibility", curve))
        shares.append(recovery.share_of(logit))
        run.log(steps, skill=index, sent_home=shares[-1], **log)
    rule = {"settings": asdict(recovery), "shares": shares}
    rl.save_chain(skills, run.work / "last", **run.origin, env_steps=steps, recovery=rule)
    run.finish()


if __name__ == "__main__":
    main()
