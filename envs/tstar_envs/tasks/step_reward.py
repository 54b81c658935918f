"""What one control step pays: the phases of `phase_reward` picked by each simulation's phase, and what pays always.

Source: docs/task.md, "Dense reward of one subtask".
"""

from __future__ import annotations

import torch
from tensordict import TensorDict
from torch import Tensor

from tstar_envs.robots import sawyer
from tstar_envs.settings import TaskSettings
from tstar_envs.tasks import phase_reward
from tstar_envs.tasks.actions import CONNECT, GRIPPER
from tstar_envs.tasks.phase_reward import Scene
from tstar_envs.tasks.recipe_tables import RecipeTables


class StepReward:
    """The reward of a step, and the part of the episode state that it remembers from one step to the next.

    `settings.skipped_phases` says what joining two parts before the last phase pays (docs/decisions/0007-chair.md).
    """

    def __init__(self, tables: RecipeTables, device: torch.device, settings: TaskSettings):
        self.tables = tables
        self._bonuses = phase_reward.BONUS * torch.tensor(
            phase_reward.BONUS_SHARES, dtype=torch.float64, device=device
        )
        self._pays_skipped = settings.skipped_phases == "paid"
        remaining = self._bonuses.flip(0).cumsum(0).flip(0)  # of a phase and those after it
        self._joining = remaining if self._pays_skipped else self._bonuses[-1:].expand_as(self._bonuses)

    def potentials(self, scene: Scene, state: TensorDict) -> Tensor:
        """Potential of each phase, (N, 8)."""
        return phase_reward.potentials(scene, state["start_tip"], state["lift_point"], self.tables.z_finedist)

    def pay(self, state: TensorDict, scene: Scene, action: Tensor, connected: Tensor) -> Tensor:
        """Reward (N,) of the step that led to `scene`; moves `phase`, `potential` and what was paid on in `state`.

        `action` is (N, 9), `connected` (N,) bool: two parts were joined in this step. Joining them ends the subtask
        from any phase. With skipped phases paid it pays what the phases left out would have, so that a policy that
        joins early does not earn less than one that lifts, aligns and then fails; unpaid, the last bonus alone.
        """
        phase, grip = state["phase"], action[:, GRIPPER]
        potential = self.potentials(scene, state)
        carrying = phase >= 4
        fall = (state["potential"] - potential).gather(-1, phase.unsqueeze(-1)).squeeze(-1)
        lost = carrying & ~scene.touching & ~connected
        difference = phase_reward.DIFFERENCE_SCALE * torch.where(lost, fall.clamp_max(0), fall)
        difference = difference + 200.0 * (grip - state["grip_action"]) * (phase == 3)

        met = phase_reward.conditions(
            scene, state["start_tip"], state["lift_point"], self.tables.z_finedist, grip < 0, connected
        )
        done = met.gather(-1, phase.unsqueeze(-1)).squeeze(-1) | connected
        paid = torch.where(connected, self._joining[phase], self._bonuses[phase]) * done
        rise = self.tables.waypoint[self.tables.step_index(state["subtask"]), 2]
        off_ground = phase_reward.off_ground(scene, state["lift_point"], rise)
        raised = ~state["half_paid"] & (phase == 4) & off_ground
        if self._pays_skipped:
            raised = raised | (~state["half_paid"] & connected & (phase <= 4))
        asking = 10.0 * (action[:, CONNECT] + 1) * ((phase == 7) & scene.alignment.aligned & ~connected)
        bonus = paid + 0.5 * self._bonuses[4] * raised + asking - state["asked"] * connected

        every_step = _every_step(state, scene, action, lost)
        state["half_paid"] = state["half_paid"] | raised
        state["asked"] = state["asked"] + asking
        state["potential"], state["grip_action"] = potential, grip.clone()
        state["phase"] = (phase + (done & ~connected)).clamp_max(len(phase_reward.PHASES) - 1)
        return difference + bonus + every_step


def moved(state: TensorDict, scene: Scene) -> Tensor:
    """How far the target connector is from where it was when the subtask began, m, (N,)."""
    return (scene.target_connector - state["start_target"]).norm(dim=-1)


def _every_step(state: TensorDict, scene: Scene, action: Tensor, lost: Tensor) -> Tensor:
    """What every control step pays, (N,): control, gripper, moved target, tilted grip, dropped part."""
    grip = action[:, GRIPPER]
    return (
        -0.001 * action[:, : sawyer.NUM_JOINTS].norm(dim=-1)
        + torch.where(state["phase"] <= 2, -grip, grip)
        - 50.0 * moved(state, scene)
        + phase_reward.grip_penalty(scene, state["phase"])
        - 20.0 * lost
    )
