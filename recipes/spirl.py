"""SPiRL: latent actions and their prior from demonstrations, then a policy over them, of a subtask or the whole task.

python recipes/spirl.py task=table_lack subtask=0 scale=laptop seed=0
"""

from omegaconf import DictConfig

import tstar_rl as rl
from tstar_rl import spirl
from tstar_rl.config.schema import SpirlSection


@rl.recipe("spirl", spirl=SpirlSection)
def main(config: DictConfig) -> None:
    """Fits the latent model to demonstrations, then trains a policy over latents that stays near the prior."""
    values, seed = config.spirl, rl.derive_seed(config.seed, "train", config.subtask)
    agent, expert = rl.new_spirl_agent(config, config.subtask), rl.load_demonstrations(config, config.subtask)
    agent.normalizer.fit(expert.observations, config.normalizer.floor)
    horizon, latent_dim = agent.settings.horizon, agent.settings.latent_dim
    fit = rl.settings(spirl.ModelTrainingSettings, values.model_training)
    windows = spirl.split_windows(expert, horizon, fit)
    update_policy = spirl.LatentPolicyUpdate(agent, rl.settings(spirl.LatentPolicySettings, values.policy))
    reward, buffer = rl.settings(rl.RewardMixture, config.reward), spirl.new_buffer(values.capacity)
    env = rl.environment(config, config.subtask, values.num_envs, seed, max_steps=values.max_steps)
    env.append_transform(spirl.LatentExecution(agent.model.decoder, latent_dim, horizon))
    training = spirl.SpirlTraining(
        rl.plain(config), agent, env, seed, update_policy=update_policy, buffer=buffer
    )

    if training.is_new:  # stage 1: q(z | a), p(a | z, s) and the prior p(z | s)
        for log in spirl.train_latent_model(agent.model, *windows, fit, seed):
            training.log_model(log)
        agent.start_from_prior()
        training.save("prior")

    # Stage 2: z ~ pi(z | s) is played for H steps, then pi, Q and alpha learn.
    for rollout in training.rollouts():
        rollout = reward(rollout)
        buffer.extend(rollout.select(*spirl.TRANSITION).reshape(-1))
        log = update_policy(buffer, rollout.numel())
        training.log(rollout, log)


if __name__ == "__main__":
    main()
