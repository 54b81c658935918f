"""A chain of trained skills whose normalisers have seen the chain. Nothing is trained.

    python recipes/refitted.py task=table_lack scale=narrow seed=0
    python recipes/evaluate.py system=refitted scale=narrow seed=0

of skills of that scale, in folders of their own (docs/usage.md, "Step by step", has such commands).

An input that varies more in the chain than it did in training is scaled by its deviation in the chain. A control as
`floored.py` is, without a number to choose. Policies and value networks are left as they are, and so is what they see
of every other input.
"""

import time

from omegaconf import DictConfig

import tstar_rl as rl


@rl.recipe("refitted", from_checkpoint=str)
def main(config: DictConfig) -> None:
    """Runs the chain once, widens every skill's normaliser, and saves the chain; logs how many inputs were widened.

    Raises:
        InvalidValueError: if none was.
    """
    if config.chain.path_steps < 1:
        raise rl.InvalidValueError(
            "normalisers see the ends of episodes: chain.path_steps must be at least 1, got 0"
        )
    skills, chain = rl.load_skills(config, checkpoint=config.from_checkpoint), config.chain
    began = time.perf_counter()
    trial = rl.run_trial(skills, rl.trial_env(config, chain.trial_episodes, "harvest"), chain.path_steps)
    seconds = time.perf_counter() - began
    found = zip(skills, trial.skills, strict=True)
    widened = [skill.normalizer.widen(skills_trial.path.states) for skill, skills_trial in found]
    if not any(widened):
        raise rl.InvalidValueError(
            "no input varies more in the chain than it did in training: the chain would be the skills as they are"
        )
    run = rl.chain_run(config, len(skills))
    run.start()
    run.seconds += seconds
    for index, inputs in enumerate(widened):
        run.log(trial.steps(), skill=index, widened_inputs=inputs)
    rl.save_chain(skills, run.work / "last", **run.origin, env_steps=trial.steps())
    run.finish()


if __name__ == "__main__":
    main()
