"""Skill-prior reinforcement learning of one subtask, or of the whole task.

python recipes/spirl.py task=table_lack subtask=0 scale=laptop seed=0
"""

import torch
from omegaconf import DictConfig
from torchrl.data import LazyTensorStorage, TensorDictReplayBuffer

from tstar_rl.config.build import environment, load_demonstrations, new_skill_agent
from tstar_rl.config.load import plain, recipe, settings
from tstar_rl.config.schema import SpirlSection
from tstar_rl.rollouts.collection import Collection, rollout_metrics
from tstar_rl.runs.run import Run
from tstar_rl.seeds import derive_seed
from tstar_rl.spirl.skill_execution import SkillExecution
from tstar_rl.spirl.train_skill_model import SkillModelTraining, held_out_windows, train_skill_model
from tstar_rl.spirl.update_policy import TRANSITION, SkillPolicySettings, SkillPolicyUpdate
from tstar_rl.transforms import RewardMixture


@recipe("spirl", spirl=SpirlSection)
def main(config: DictConfig) -> None:
    """Skills and their prior from demonstrations, then a policy over skills by prior-regularised actor-critic."""
    spirl, total = config.spirl, config.spirl.total_steps
    if config.collection.backend != "local":
        raise ValueError(
            "spirl.py runs with collection.backend=local: its decoder acts inside the environment"
        )
    run = Run(plain(config), config.subtask, total)
    # Nothing depends on the total, so a run may be resumed with a larger one.
    run.record["spirl"] = {name: value for name, value in plain(spirl).items() if name != "total_steps"}
    seed = derive_seed(config.seed, "train", config.subtask)
    agent = new_skill_agent(config, config.subtask)
    expert = load_demonstrations(config, config.subtask)
    agent.normalizer.fit(expert.observations, config.normalizer.floor)
    sac = settings(SkillPolicySettings, spirl.policy)
    update_policy = SkillPolicyUpdate(agent.actor, agent.critic, agent.model.prior, sac)
    reward = settings(RewardMixture, config.reward)
    buffer = TensorDictReplayBuffer(storage=LazyTensorStorage(spirl.capacity))
    env = environment(config, config.subtask, spirl.num_envs, seed, max_steps=spirl.max_steps)
    horizon, latent = spirl.model.horizon, spirl.model.latent
    env.append_transform(SkillExecution(agent.model.decoder, latent, horizon))
    collection = Collection(env, agent.actor, 1)
    steps = run.start(agent=agent, collection=collection, update_policy=update_policy, buffer=buffer)
    if steps == 0:
        training = settings(SkillModelTraining, spirl.training)
        torch.manual_seed(seed)
        for log in train_skill_model(
            agent.model, *held_out_windows(expert, horizon, training), training, seed
        ):
            run.log(0, **log)
        agent.start_from_prior()
        agent.save(run.work / "prior", recipe=config.system, env_steps=0)
        torch.manual_seed(seed)

    while steps < total:
        rollout = collection.rollout()
        steps += int(rollout["next", "skill_steps"].sum())
        rollout = reward(rollout)
        buffer.extend(rollout.select(*TRANSITION).reshape(-1))
        log = update_policy(buffer, rollout.numel()) | collection.counts()
        run.log(steps, **rollout_metrics(rollout), **log)
        if run.improved:
            agent.save(run.work / "best", recipe=config.system, env_steps=steps)
        run.save_if_due(spirl.checkpoint_every)

    agent.save(run.work / "last", recipe=config.system, env_steps=steps)
    run.finish()


if __name__ == "__main__":
    main()
