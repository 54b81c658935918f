"""SPiRL: latent actions and their prior from demonstrations, then a policy over them, of a subtask or the whole task.

python recipes/spirl.py task=table_lack subtask=0 scale=laptop seed=0
"""

from omegaconf import DictConfig
from torchrl.data import LazyTensorStorage, TensorDictReplayBuffer

from tstar_rl.config.build import environment, load_demonstrations, new_spirl_agent
from tstar_rl.config.load import recipe
from tstar_rl.config.schema import SpirlSection
from tstar_rl.config.values import plain, settings
from tstar_rl.seeds import derive_seed
from tstar_rl.spirl import (
    TRANSITION,
    LatentExecution,
    LatentPolicySettings,
    LatentPolicyUpdate,
    ModelTrainingSettings,
    SpirlTraining,
    split_windows,
    train_latent_model,
)
from tstar_rl.transforms import RewardMixture


@recipe("spirl", spirl=SpirlSection)
def main(config: DictConfig) -> None:
    """Fits the latent model to demonstrations, then trains a policy over latents that stays near the prior."""
    spirl, seed = config.spirl, derive_seed(config.seed, "train", config.subtask)
    agent, expert = new_spirl_agent(config, config.subtask), load_demonstrations(config, config.subtask)
    agent.normalizer.fit(expert.observations, config.normalizer.floor)
    update_policy = LatentPolicyUpdate(agent, settings(LatentPolicySettings, spirl.policy))
    reward = settings(RewardMixture, config.reward)
    buffer = TensorDictReplayBuffer(storage=LazyTensorStorage(spirl.capacity))
    horizon, latent_dim = agent.settings.horizon, agent.settings.latent_dim
    env = environment(config, config.subtask, spirl.num_envs, seed, max_steps=spirl.max_steps)
    env.append_transform(LatentExecution(agent.model.decoder, latent_dim, horizon))
    training = SpirlTraining(plain(config), agent, env, seed, update_policy=update_policy, buffer=buffer)

    if training.is_new:  # stage 1: q(z | a), p(a | z, s) and the prior p(z | s)
        fit = settings(ModelTrainingSettings, spirl.model_training)
        for log in train_latent_model(agent.model, *split_windows(expert, horizon, fit), fit, seed):
            training.log_model(log)
        agent.start_from_prior()
        training.keep("prior")

    # Stage 2: z ~ pi(z | s) is played for H steps, then pi, Q and alpha learn.
    for rollout in training.rollouts():
        rollout = reward(rollout)
        buffer.extend(rollout.select(*TRANSITION).reshape(-1))
        log = update_policy(buffer, rollout.numel())
        training.log(rollout, log)


if __name__ == "__main__":
    main()
