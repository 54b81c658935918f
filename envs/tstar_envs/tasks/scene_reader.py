"""What the simulations look like to the subtask that each is at."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from tstar_envs.connection import ALIGNED, Alignment
from tstar_envs.physics.view import PhysicsView
from tstar_envs.robots import sawyer
from tstar_envs.tasks.measures import MEASURES, POINTS, TURNED, VECTORS, Measures
from tstar_envs.tasks.recipe_tables import RecipeTables
from tstar_envs.tasks.task import EpisodeState

_ALIGNMENT = slice(MEASURES["gap"], MEASURES["gap"] + len(ALIGNED))
_OVER_LIFT = MEASURES["part_over_lift"]
OFF_GROUND = 0.01
"""Height above its start at which a part counts as raised, m."""
_REMEMBERED = ("start_tip", "start_target", "lift_point")


class Scene(NamedTuple):
    """What the reward and the scripted expert look at; positions in m, world frame."""

    vectors: Tensor  # (3, V, N), named in `measures.VECTORS`
    measures: Tensor  # (M, N), named in `measures.MEASURES`
    touches: Tensor  # (2, parts, N) bool, which finger touches which part
    touching: Tensor  # (N,) bool, both fingers on the moving part or on what is welded to it
    aligned: Tensor  # (N,) bool, `alignment.aligned`
    raised: Tensor  # (N,) bool, the moving part is a centimetre above where it lay when the subtask began

    def vector(self, name: str) -> Tensor:
        """A point or axis by name, (N, 3)."""
        return self.vectors[:, VECTORS[name]].t().contiguous()

    def measure(self, name: str) -> Tensor:
        """A measure by name, (N,)."""
        return self.measures[MEASURES[name]]

    @property
    def tip(self) -> Tensor:
        """(N, 3), between the finger tips."""
        return self.vector("hand.origin")

    @property
    def approach(self) -> Tensor:
        """(N, 3), the hand's z axis."""
        return self.vector("hand.z")

    @property
    def closing(self) -> Tensor:
        """(N, 3), the hand's y axis."""
        return self.vector("hand.y")

    @property
    def part(self) -> Tensor:
        """(N, 3), the moving part."""
        return self.vector("moving.origin")

    @property
    def grasp_point(self) -> Tensor:
        """(N, 3)."""
        return self.vector("moving.grasp_point")

    @property
    def grasp_axis(self) -> Tensor:
        """(N, 3)."""
        return self.vector("moving.grasp_axis")

    @property
    def grip_direction(self) -> Tensor:
        """(N, 3), the approach direction asked for while grasping."""
        return self.vector("grip_direction")

    @property
    def retreat(self) -> Tensor:
        """(N, 3), unit, from the grasp point to where the hand waits before it grasps."""
        return self.vector("retreat")

    @property
    def way_out(self) -> Tensor:
        """(N, 3), unit, from the target connector to where the moving one comes from."""
        return self.vector("target.way_out")

    @property
    def moving_connector(self) -> Tensor:
        """(N, 3)."""
        return self.vector("moving.connector")

    @property
    def target_connector(self) -> Tensor:
        """(N, 3)."""
        return self.vector("target.connector")

    @property
    def alignment(self) -> Alignment:
        """How the moving connector lies to its target."""
        names = ("gap", "up", "forward", "moving_projection", "target_projection")
        return Alignment(*(self.measure(name) for name in names))


class SceneReader:
    """Reads scenes off the simulations of `physics`, in few operations: all frames turn their points and axes at once.

    A simulation whose steps are all done is seen as at the last one. What depends on the step alone is looked up again
    only when a simulation is at another step than before.
    """

    def __init__(self, tables: RecipeTables, physics: PhysicsView, part_names: tuple[str, ...]):
        self._tables, self._device = tables, physics.device
        self._measure = Measures(tables.z_finedist, physics.device)
        self._turn = _Turn(physics.device)
        bounds = torch.tensor(ALIGNED, dtype=torch.float64, device=physics.device)
        self._least, self._most = bounds.t().unsqueeze(-1)
        self._poses = [
            physics.qpos[:, sawyer.NUM_QPOS :],
            physics.sensor("tip_pos"),
            physics.sensor("hand_quat"),
        ]
        fingers = [f"{finger}_touches_{part}" for finger in sawyer.FINGERS for part in part_names]
        self._contacts = physics.sensors(fingers).t().unflatten(0, (len(sawyer.FINGERS), tables.num_parts))
        self._at: _AtSteps | None = None

    def read(self, state: EpisodeState) -> Scene:
        """The scenes of `state`."""
        at = self._look_up(state["subtask"])
        vectors = self._vectors(state, at)
        touches = self._contacts > 0
        touching = (touches & at.group).any(1).all(0)
        measures = self._measure(vectors, at.turns)
        lies = measures[_ALIGNMENT]
        aligned = ((lies > self._least) & (lies < self._most)).all(0)
        return Scene(vectors, measures, touches, touching, aligned, measures[_OVER_LIFT] > at.lying)

    def _look_up(self, subtask: Tensor) -> _AtSteps:
        # On a GPU the comparison would make the host wait.
        if self._at is None or self._device.type != "cpu" or not torch.equal(self._at.subtask, subtask):
            self._at = _at_steps(self._tables, subtask.clone())
        return self._at

    def _vectors(self, state: EpisodeState, at: _AtSteps) -> Tensor:
        """Points and axes (3, V, N), m, world."""
        n = len(at.subtask)
        known = torch.cat([*self._poses, *(state[name] for name in _REMEMBERED)], dim=-1)
        rows = known.gather(1, at.places).t().contiguous()
        origins, remembered = rows[:9].view(3, 3, n), rows[21:].view(3, 3, n)
        frames = self._turn(rows[9:21].view(4, 3, n))
        turned = (frames[:, :, :2].unsqueeze(3) * at.columns).sum(1)
        turned = torch.addcmul(turned, origins[:, :2].unsqueeze(2), at.is_point).flatten(1, 2)
        turned[:, _WAY_OUT] += at.way_up
        hand = frames[:, 1:, 2]
        return torch.cat([turned, origins, hand, remembered, at.directions], dim=1)


class _Turn:
    """Rotation matrices (3, 3, ...) of quaternions (4, ...): `geometry.quat_to_matrix` with simulations last."""

    def __init__(self, device: torch.device):
        w, x, y, z = range(4)
        entries = (
            (y, y, z, z, 1), (x, y, w, z, -1), (x, z, w, y, 1),
            (x, y, w, z, 1), (x, x, z, z, 1), (y, z, w, x, -1),
            (x, z, w, y, -1), (y, z, w, x, 1), (x, x, y, y, 1),
        )  # fmt: skip
        self._first = torch.tensor([4 * a + b for a, b, _, _, _ in entries], device=device)
        self._second = torch.tensor([4 * c + d for _, _, c, d, _ in entries], device=device)
        signs = torch.tensor([sign for *_, sign in entries], dtype=torch.float64, device=device)
        self._sign = signs.view(-1, 1, 1)
        self._one = torch.eye(3, dtype=torch.float64, device=device).view(-1, 1, 1)
        self._scale = 2 - 4 * self._one  # 1 - 2 (a + b) on the diagonal, 2 (a + b) beside it

    def __call__(self, quats: Tensor) -> Tensor:
        """quats: (4, F, N) -> (3, 3, F, N)."""
        products = (quats.unsqueeze(1) * quats).flatten(0, 1)
        sums = torch.addcmul(
            products.index_select(0, self._first), products.index_select(0, self._second), self._sign
        )
        return torch.addcmul(self._one, sums, self._scale).view(3, 3, *quats.shape[1:])


class _AtSteps(NamedTuple):
    """Rows of the recipe's tables for simulations at the steps `subtask`."""

    subtask: Tensor  # (N,)
    places: (
        Tensor  # (N, 30): columns of what is known: three origins, three quaternions, three remembered points
    )
    columns: Tensor  # (3, 2, rows, N): points and axes in the frames of the moving and the target part
    is_point: Tensor  # (2, rows, 1)
    turns: Tensor  # (2, R, N), see `Measures`
    group: Tensor  # (parts, N) bool, parts that move along
    directions: Tensor  # (3, 3, N), world: the last of `measures.VECTORS`, which the recipe asks for
    way_up: Tensor  # (3, N), world: straight up where the way out does not turn with the target, else zero
    lying: Tensor  # (N,), m, how far over the lift point a part is that is just raised: less than 0


_WAY_OUT = VECTORS["target.way_out"]


def _at_steps(tables: RecipeTables, subtask: Tensor) -> _AtSteps:
    step, hand = tables.step_index(subtask), 7 * tables.num_parts
    first = torch.stack(
        [7 * tables.moving[step], 7 * tables.target[step], torch.full_like(step, hand)], dim=-1
    )
    frames = torch.cat([first + i for i in range(7)], dim=-1)  # x of the three, y of the three, ...
    points = hand + 7 + torch.arange(9, device=step.device).view(3, 3).t().reshape(1, -1)
    places = torch.cat([frames, points.expand(len(step), -1)], dim=-1)
    turns = torch.stack([tables.allowed_angles.cos(), -tables.allowed_angles.sin()])
    up = tables.retreat.new_tensor([0.0, 0.0, 1.0]).expand(len(step), 3)
    directions = torch.stack([tables.grip_direction[step], tables.retreat[step], up], dim=1)
    return _AtSteps(
        subtask, places, _columns(tables)[..., step], _is_point(step.device),
        turns[:, step].transpose(1, 2).contiguous(),
        tables.group[step].t().contiguous(), directions.permute(2, 1, 0).contiguous(),
        (up * ~tables.follows_axis[step]).t().contiguous(), OFF_GROUND - tables.waypoint[step, 2],
    )  # fmt: skip


def _columns(tables: RecipeTables) -> Tensor:
    """(3, 2, rows, K): see `measures.TURNED`; a way out that does not turn with the target is zero here."""
    moving, target = tables.moving_frame.permute(1, 2, 0), tables.target_frame.permute(1, 2, 0)
    out = moving.new_zeros(3, 2, len(TURNED["moving"]), tables.num_steps)
    out[:, 0, 0], out[:, 0, 1:3] = tables.moving_connector[:, :3].t(), moving[:, 1:]
    out[:, 0, 3], out[:, 0, 4] = tables.grasp_point.t(), tables.grasp_axis.t()
    out[:, 1, 0], out[:, 1, 1:4] = tables.target_connector[:, :3].t(), target
    out[:, 1, 4] = (tables.way_out * tables.follows_axis).t()
    return out


def _is_point(device: torch.device) -> Tensor:
    rows = [[float(row in POINTS) for row in frame] for frame in TURNED.values()]
    return torch.tensor(rows, dtype=torch.float64, device=device).unsqueeze(-1)
