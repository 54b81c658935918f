"""What one control step pays: the phases of `phase_reward` picked by each simulation's phase, and what pays always.

Source: environment.md, "Dense reward of one subtask".
"""

from __future__ import annotations

import torch
from tensordict import TensorDict
from torch import Tensor

from tstar_envs.robots import sawyer
from tstar_envs.settings import TaskSettings
from tstar_envs.tasks import phase_reward
from tstar_envs.tasks.actions import CONNECT, GRIPPER
from tstar_envs.tasks.phase_reward import PHASES, PhaseTables
from tstar_envs.tasks.recipe_tables import RecipeTables
from tstar_envs.tasks.scene_reader import Scene

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
        rows = {
            "bonus": bonuses,
            "joining": joining,
            "closing": [200.0 * (i == _GRASP) for i in numbers],
            "asking": [10.0 * (i == _FINE) for i in numbers],
            "grip": [-1.0 if i < _GRASP else 1.0 for i in numbers],
            "tilt": [4.0 * (i <= _LIFT) for i in numbers],
            "turn": [2.0 * (1 <= i <= _LIFT) for i in numbers],
        }
        self._by_phase = torch.tensor(
            list(zip(*rows.values(), strict=True)), dtype=torch.float64, device=device
        )
        """(8, 7): bonus; bonus of joining; what closing, asking, the gripper's sign, tilt and turn of the hand pay."""
        self._half = 0.5 * bonuses[_LIFT]
        self._rise = tables.waypoint[:, 2].index_select(
            0, tables.step_index(torch.arange(tables.num_steps + 1, device=device))
        )

    def potentials(self, scene: Scene) -> Tensor:
        """Potential of each phase, (N, 8)."""
        return self.phases.potentials(scene.measures)

    def pay(self, state: TensorDict, scene: Scene, action: Tensor, connected: Tensor) -> Tensor:
        """Reward (N,) of the step that led to `scene`; moves `phase`, `potential` and what was paid on in `state`.

        `action` is (N, 9), `connected` (N,) bool: two parts were joined in this step. Joining them ends the subtask
        from any phase. With skipped phases paid it pays what the phases left out would have, so that a policy that
        joins early does not earn less than one that lifts, aligns and then fails; unpaid, the last bonus alone.
        """
        phase, half_paid, grip, connect = (
            state["phase"],
            state["half_paid"],
            action[:, GRIPPER],
            action[:, CONNECT],
        )
        bonus, joining, closing, asks, sign, tilt, turn = self._by_phase.index_select(0, phase).unbind(-1)
        potential, row, not_connected = self.potentials(scene), phase.unsqueeze(-1), ~connected
        fall = (state["potential"] - potential).gather(-1, row).squeeze(-1)
        lost = (phase >= _LIFT) & ~scene.touching & not_connected
        difference = phase_reward.DIFFERENCE_SCALE * torch.where(lost, fall.clamp_max(0), fall)
        difference = difference + (grip - state["grip_action"]) * closing

        met = self.phases.conditions(scene.measures, scene.touching, grip < 0, connected)
        done = met.gather(-1, row).squeeze(-1) | connected
        raised = self._raised(state, scene, phase, connected) & ~half_paid
        asking = (connect + 1) * asks * (scene.aligned & not_connected)
        paid = torch.where(connected, joining, bonus) * done + self._half * raised
        paid = paid + asking - state["asked"] * connected

        always = -0.001 * torch.linalg.vector_norm(action[:, : sawyer.NUM_JOINTS], dim=-1) + sign * grip
        always = always - 50.0 * moved(scene)
        always = (
            always + ((scene.measure("down") - 1) * tilt + (scene.measure("turn") - 1) * turn) - 20.0 * lost
        )
        state["half_paid"] = half_paid | raised
        state["asked"] = state["asked"] + asking
        state["potential"], state["grip_action"] = potential, grip.clone()
        state["phase"] = (phase + (done & not_connected)).clamp_max(len(PHASES) - 1)
        return difference + paid + always

    def _raised(self, state: TensorDict, scene: Scene, phase: Tensor, connected: Tensor) -> Tensor:
        """(N,) bool: the part is a centimetre above where it lay, which the lift point is a known rise above."""
        rise = self._rise.index_select(0, state["subtask"])
        high = scene.part[:, 2] > state["lift_point"][:, 2] - rise + phase_reward.OFF_GROUND
        raised = (phase == _LIFT) & high
        return raised | (connected & (phase <= _LIFT)) if self._pays_skipped else raised


def moved(scene: Scene) -> Tensor:
    """How far the target connector is from where it was when the subtask began, m, (N,)."""
    return scene.measure("target_moved")
