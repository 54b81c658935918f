"""The agent of SPiRL, and the run that trains it."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch
from tensordict import TensorDictBase
from torchrl.envs import TransformedEnv

from tstar_rl.checks import InvalidValueError
from tstar_rl.models.normalizer import Normalizer
from tstar_rl.models.relative_features import RelativeFeatures
from tstar_rl.models.state_input import StateInput
from tstar_rl.rollouts.collection import Collection, rollout_metrics
from tstar_rl.runs import checkpoint
from tstar_rl.runs.mismatch import CHAINING
from tstar_rl.runs.run import Run
from tstar_rl.runs.saved_kinds import AN_AGENT, kind_of
from tstar_rl.spirl.latent_execution import LatentPolicy
from tstar_rl.spirl.model import LatentModel, LatentModelSettings, LatentPrior, make_latent_actor

__all__ = ["SpirlAgent", "SpirlTraining"]


class SpirlAgent:
    """The latent model of one task or subtask, and the policy over its latents.

    `actor` chooses a latent for H steps. `policy` acts with it step by step, as evaluation needs.

    Args:
        task: furniture.
        subtask: 0-based; None for the whole task.
        settings: of the latent model.
        obs_dim: O, the numbers in an observation of the task.
        geometry: what `FurnitureEnv.geometry(subtask)` gives, if the networks are to see `RelativeFeatures`.
    """

    def __init__(
        self,
        task: str,
        subtask: int | None,
        settings: LatentModelSettings,
        obs_dim: int,
        geometry: dict[str, Any] | None = None,
    ) -> None:
        self.task, self.subtask, self.settings = task, subtask, settings
        self.obs_dim, self.geometry = obs_dim, geometry
        self.normalizer = Normalizer(obs_dim)
        features = RelativeFeatures(geometry) if geometry is not None else None
        self.state = StateInput(obs_dim, self.normalizer, features)
        self.model = LatentModel(settings, self.state)
        self.network = LatentPrior(settings, self.state)
        self.actor = make_latent_actor(self.network)
        self.policy = LatentPolicy(self.actor, self.model.decoder, settings.horizon)

    def start_from_prior(self) -> None:
        """Makes the policy equal to the prior. Source: SPiRL's appendix."""
        self.network.load_state_dict(self.model.prior.state_dict())

    def to(self, device: torch.device | str) -> "SpirlAgent":
        """Moves the networks to a device, in place."""
        for module in (self.model, self.network):
            module.to(device)
        return self

    def state_dict(self) -> dict[str, Any]:
        """Latent model and policy network; both hold the normaliser."""
        return {"model": dict(self.model.state_dict()), "network": dict(self.network.state_dict())}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Takes what `state_dict` gave."""
        self.model.load_state_dict(state["model"])
        self.network.load_state_dict(state["network"])

    def save(self, path: str | Path, **record: Any) -> None:
        """Writes the agent, and a record of plain values that says what it is."""
        built = {
            "latent_model": asdict(self.settings),
            "obs_dim": self.obs_dim,
            "geometry": checkpoint.to_plain(self.geometry),
        }
        record = {"task": self.task, "subtask": self.subtask, "built": built, **record}
        checkpoint.save(path, {"agent": self}, record)

    @classmethod
    def load(cls, path: str | Path, **expected: Any) -> "SpirlAgent":
        """Builds the agent saved at `path`.

        Raises:
            FileNotFoundError: if there is none.
            CheckpointMismatchError: if a value in `expected` (task=..., subtask=...) is not the saved one, or a newer
                version saved it.
            InvalidValueError: if something else is saved there.
        """
        record = checkpoint.read_record(path, **expected)
        if (kind := kind_of(record)) != AN_AGENT:
            raise InvalidValueError(f"{path} is no agent of SPiRL, which spirl.py trains: it is {kind}")
        built = record["built"]
        agent = cls(
            record["task"],
            record["subtask"],
            checkpoint.settings_of(
                LatentModelSettings, built["latent_model"], f"{path}: the latent model has"
            ),
            built["obs_dim"],
            checkpoint.to_tensors(built["geometry"]),
        )
        checkpoint.load(path, {"agent": agent}, **expected)
        return agent


class SpirlTraining:
    """The bookkeeping of one run of SPiRL: log, checkpoints, resuming, seeds, and which agents are kept.

    `is_new` tells whether the run begins here. If it resumes, its agent has been through the first stage.

    Args:
        config: plain values of the recipe; its section "spirl" has the budget.
        agent: that is trained.
        env: plays one latent per step, see `LatentExecution`.
        seed: of everything that is drawn from torch's generator.
        **components: what else a checkpoint must hold to resume, with `state_dict`.

    Raises:
        ValueError: if the rollouts are to come from a cluster; the decoder acts inside this process.
        CheckpointMismatchError: when resuming a run that had another config.
    """

    def __init__(
        self, config: Mapping[str, Any], agent: SpirlAgent, env: TransformedEnv, seed: int, **components: Any
    ) -> None:
        backend = config["collection"]["backend"]
        if backend != "local":
            raise InvalidValueError(f"SPiRL runs with collection.backend=local only, got {backend!r}")
        self.agent, self.seed = agent, seed
        self.total, self.save_every = config["spirl"]["total_steps"], config["spirl"]["checkpoint_every"]
        self.run = Run(config, config["subtask"], self.total, unread=CHAINING)
        self.collection = Collection(env, agent.actor, 1)
        self.steps = self.run.start(agent=agent, collection=self.collection, **components)
        self.is_new, self._logged = self.steps == 0, True
        if self.is_new:
            torch.manual_seed(seed)

    def log_model(self, row: Mapping[str, float]) -> None:
        """Logs a row of the first stage, in which no environment step is taken."""
        self.run.log(0, **row)

    def save(self, name: str) -> None:
        """Saves the agent as the checkpoint `name`."""
        self.agent.save(self.run.work / name, **self.run.origin, env_steps=self.steps)

    def rollouts(self) -> Iterator[TensorDictBase]:
        """Rollouts (N, 1), one latent of each simulation, until the budget is spent; then closes the run.

        Each must be logged with `log` before the next is asked for.

        Raises:
            RuntimeError: if one was not.
        """
        if self.is_new:
            torch.manual_seed(self.seed)  # what is drawn here does not depend on how the model was trained
        while self.steps < self.total:
            rollout = self.collection.rollout()
            self.steps += int(rollout["next", "latent_steps"].sum())
            self._logged = False
            yield rollout
            if not self._logged:
                raise RuntimeError("a recipe must log each rollout: training.log(rollout, log)")
        self.collection.close()
        self.save("last")
        self.run.finish()

    def log(self, rollout: TensorDictBase, log: Mapping[str, float]) -> None:
        """Logs a rollout (N, 1) with its rewards, keeps the agent if it is the best so far, saves if it is time."""
        self._logged = True
        self.run.log(self.steps, **rollout_metrics(rollout), **log, **self.collection.counts())
        if self.run.best.improved:
            self.save("best")
        self.run.save_if_due(self.save_every)
