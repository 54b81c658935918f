"""The training of a single skill, before any chain.

for rollout in training.rollouts():
    log = update_policy(reward(rollout), training.progress)
    training.log(rollout, log)
"""

from collections.abc import Callable, Iterator
from typing import Any

import torch
from tensordict import TensorDictBase
from torch import Tensor

from tstar_rl.chaining.skill import Skill
from tstar_rl.chaining.training import AnyUpdate, Training, TrainingSettings
from tstar_rl.checks import InvalidValueError
from tstar_rl.demonstrations.data_set import Demonstrations
from tstar_rl.rollouts.collection import Collection
from tstar_rl.rollouts.ray_collection import RayCollection
from tstar_rl.runs.run import Run
from tstar_rl.updates import BehaviourCloningSettings, PolicyUpdate, behaviour_cloning

__all__ = ["SkillTraining"]


class SkillTraining(Training):
    """The training of one skill from nothing, or from a warm start.

    Args:
        skill, expert, run, settings, collection, seed: see `Training`.
        warm_start: clones the demonstrations first; None: no warm start.
        checkpoint_every: environment steps between checkpoints.
        save: writes the skill as "best" or "last", at a number of steps. The best is the skill after the update on the
            rollout that made its mean the best, see docs/decisions/0010-last-and-best.md.
    """

    def __init__(
        self,
        skill: Skill,
        expert: Demonstrations,
        run: Run,
        settings: TrainingSettings,
        collection: Collection | RayCollection,
        seed: int,
        *,
        warm_start: BehaviourCloningSettings | None,
        checkpoint_every: int,
        save: Callable[[str, int], None],
    ) -> None:
        super().__init__(skill, expert, run, settings, collection, seed)
        self.warm_start, self.checkpoint_every, self.save = warm_start, checkpoint_every, save
        self.updates: dict[str, Any] = {}

    def rollouts(self) -> Iterator[TensorDictBase]:
        """Rollouts (N, T) until the run's steps are done; goes on from a checkpoint if there is one.

        A recipe that leaves the loop before leaves a run that has not ended, without its last skill.
        """
        run, skill = self.run, self.skill
        self.steps = run.start(skill=skill, collection=self.collection, **self.updates)
        if self.steps == 0 and self.warm_start is not None:
            expert = self.expert
            behaviour_cloning(skill.policy, expert.observations, expert.actions, self.warm_start, self.seed)
            torch.manual_seed(self.seed)
        while self.steps < self.total:
            rollout = self._collect(self.progress)
            yield rollout
            run.log(self.steps, **self._finish_rollout(rollout))
            if run.best.improved:
                self.save("best", self.steps)
            run.save_if_due(self.checkpoint_every)
        self.collection.close()
        ppo = self.updates.get("update_policy")
        if isinstance(ppo, PolicyUpdate) and not ppo.actor_steps:
            print(
                "PPO took no step of the policy: the critic alone learns in the first "
                f"{self.settings.ppo.critic_warmup} rollouts (ppo.critic_warmup), and there were {ppo.updates}"
            )
        self.save("last", self.steps)
        run.finish()

    def _keep(self, name: str, made: AnyUpdate) -> AnyUpdate:
        if name in self.updates:
            raise InvalidValueError(f"the training has an {name} already: an update is made once")
        self.updates[name] = super()._keep(name, made)
        return made

    def _apart(self, rollout: TensorDictBase) -> Tensor | None:
        return rollout.get(("next", "start_chained"), None)  # no skill is before: it began in a demonstration
