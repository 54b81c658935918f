"""What one control step pays: the phases of `phase_reward` picked by each simulation's phase, and what pays always.

Source: docs/task.md, "Dense reward of one subtask".
"""

from __future__ import annotations

import torch
from torch import Tensor

from tstar_envs.robots import sawyer
from tstar_envs.settings import TaskSettings
from tstar_envs.tasks import phase_reward
from tstar_envs.tasks.actions import CONNECT, GRIPPER
from tstar_envs.tasks.measures import MEASURES
from tstar_envs.tasks.phase_reward import PHASES, PhaseTables
from tstar_envs.tasks.recipe_tables import RecipeTables
from tstar_envs.tasks.scene_reader import Scene
from tstar_envs.tasks.task import EpisodeState

_HAND_PAYS = 5  # the first row of what the hand's tilt and turn pay
_HAND = slice(MEASURES["down"], MEASURES["down"] + 2)  # and "turn"
_GRASP, _LIFT, _FINE = (PHASES.index(name) for name in ("grasp_leg", "lift_leg", "move_leg_fine"))


class StepReward:
    """The reward of a step, and the part of the episode state that it remembers from one step to the next.

    `settings.skipped_phases` says what joining two parts before the last phase pays (docs/decisions/0007-chair.md).
    """

    def __init__(self, tables: RecipeTables, device: torch.device, settings: TaskSettings):
        self.phases = PhaseTables(device)
        self._pays_skipped = settings.skipped_phases == "paid"
        bonuses = [phase_reward.BONUS * share for share in phase_reward.BONUS_SHARES]
        remaining = [sum(bonuses[i:]) for i in range(len(PHASES))]  # of a phase and those after it
        joining = remaining if self._pays_skipped else bonuses[-1:] * len(PHASES)
        numbers = range(len(PHASES))
        rows = (
            bonuses,
            joining,
            [200.0 * (i == _GRASP) for i in numbers],  # what closing pays
            [10.0 * (i == _FINE) for i in numbers],  # asking to connect
            [-1.0 if i < _GRASP else 1.0 for i in numbers],  # the gripper's action
            [4.0 * (i <= _LIFT) for i in numbers],  # a tilted hand
            [2.0 * (1 <= i <= _LIFT) for i in numbers],  # a turned one
        )
        self._by_phase = torch.tensor(rows, dtype=torch.float64, device=device)  # (7, 8)

        def number(value: float) -> Tensor:
            return torch.tensor(value, dtype=torch.float64, device=device)

        self._half, self._dropping, self._none = number(0.5 * bonuses[_LIFT]), number(20.0), number(0.0)

    def potentials(self, scene: Scene) -> Tensor:
        """Potential of each phase, (N, 8)."""
        return self.phases.potentials(scene.measures)

    def pay(self, state: EpisodeState, scene: Scene, action: Tensor, connected: Tensor) -> Tensor:
        """Reward (N,) of the step that led to `scene`; moves `phase`, `potential` and what was paid on in `state`.

        `action` is (N, 9), `connected` (N,) bool: two parts were joined in this step. Joining them ends the subtask
        from any phase. With skipped phases paid it pays what the phases left out would have, so that a policy that
        joins early does not earn less than one that lifts, aligns and then fails; unpaid, the last bonus alone.
        """
        phase, half_paid, grip, none = state["phase"], state["half_paid"], action[:, GRIPPER], self._none
        by_phase = self._by_phase.index_select(1, phase)
        bonus, joining, closing, asks, grips = by_phase[:_HAND_PAYS].unbind()
        potential, not_connected, at = self.potentials(scene), ~connected, phase.unsqueeze(0)
        fall = (state["potential"] - potential).gather(-1, at.t()).squeeze(-1)
        lost = (phase >= _LIFT) & ~scene.touching & not_connected
        difference = phase_reward.DIFFERENCE_SCALE * torch.where(lost, torch.minimum(fall, none), fall)
        difference = difference + (grip - state["grip_action"]) * closing

        met = self.phases.conditions(scene.measures, scene.touching, grip < none, connected)
        done = met.gather(0, at).squeeze(0) | connected
        raised = (phase == _LIFT) & scene.raised
        if self._pays_skipped:
            raised = raised | (connected & (phase <= _LIFT))
        raised = raised & ~half_paid
        asking = torch.where(scene.aligned & not_connected, (action[:, CONNECT] + 1.0) * asks, none)
        paid = torch.where(done, torch.where(connected, joining, bonus), none)
        paid = (
            paid
            + torch.where(raised, self._half, none)
            + asking
            - torch.where(connected, state["asked"], none)
        )

        always = grips * grip - 0.001 * torch.linalg.vector_norm(action[:, : sawyer.NUM_JOINTS], dim=-1)
        always = always - 50.0 * moved(scene) + ((scene.measures[_HAND] - 1.0) * by_phase[_HAND_PAYS:]).sum(0)
        always = always - torch.where(lost, self._dropping, none)
        state["half_paid"] = half_paid | raised
        state["asked"] = state["asked"] + asking
        state["potential"], state["grip_action"] = potential, grip.clone()
        state["phase"] = (phase + (done & not_connected)).clamp_max(len(PHASES) - 1)
        return difference + paid + always


def moved(scene: Scene) -> Tensor:
    """How far the target connector is from where it was when the subtask began, m, (N,)."""
    return scene.measure("target_moved")
