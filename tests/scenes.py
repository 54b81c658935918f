"""Scenes for tests, made of points and axes by hand."""

import torch
from torch import Tensor

from tstar_envs.connection import Alignment
from tstar_envs.tasks.measures import MEASURES, VECTORS, Measures
from tstar_envs.tasks.scene_reader import OFF_GROUND, Scene

GRASP, LIFT, START = (0.1, 0.2, 0.01), (0.1, 0.2, 0.11), (0.4, 0.2, 0.3)
OPEN, NO = torch.tensor([True]), torch.tensor([False])
Z_FINEDIST, RISE = 0.05, 0.1
NAMES = {
    "tip": "hand.origin", "approach": "hand.z", "closing": "hand.y", "part": "moving.origin",
    "grasp_point": "moving.grasp_point", "grasp_axis": "moving.grasp_axis", "moving_connector": "moving.connector",
    "target_connector": "target.connector", "way_out": "target.way_out",
}  # fmt: skip


def row(*values: float) -> Tensor:
    return torch.tensor([values], dtype=torch.float64)


def alignment(distance=0.2, up=1.0, forward=1.0, moving=1.0, target=1.0) -> Alignment:
    return Alignment(
        *(torch.tensor([v], dtype=torch.float64) for v in (distance, up, forward, moving, target))
    )


FAR = alignment()


def measured(vectors: Tensor) -> Tensor:
    """What is measured (M, N) on vectors (3, V, N), no turn but 0 being allowed."""
    turns = torch.tensor([[[1.0]], [[0.0]]], dtype=torch.float64).expand(-1, -1, vectors.shape[-1])
    return Measures(Z_FINEDIST, vectors.device)(vectors, turns)


def scene(alignment: Alignment = FAR, touching: Tensor = NO, **changed: Tensor) -> Scene:
    """The hand at its start over a lying part, 0.2 m from the target; how connectors lie is given apart."""
    vectors = torch.zeros(3, len(VECTORS), 1, dtype=torch.float64)
    base = {
        "tip": row(*START), "approach": row(0, 0, -1), "closing": row(1, 0, 0), "part": row(*GRASP),
        "grasp_point": row(*GRASP), "grasp_axis": row(1, 0, 0), "grip_direction": row(0, 0, -1),
        "moving_connector": row(0, 0, 0.3), "target_connector": row(0, 0, 0.1), "start_tip": row(*START),
        "lift_point": row(*LIFT), "start_target": row(0, 0, 0.1),
        "retreat": row(0, 0, 1), "way_out": row(0, 0, 1), "up": row(0, 0, 1),
    }  # fmt: skip
    for name, value in {**base, **changed}.items():
        vectors[:, VECTORS[NAMES.get(name, name)]] = value.t()
    measures = measured(vectors)
    for name, value in zip(
        ("gap", "up", "forward", "moving_projection", "target_projection"), alignment, strict=True
    ):
        measures[MEASURES[name]] = value
    touches = torch.zeros(2, 1, 1, dtype=torch.bool)
    raised = measures[MEASURES["part_over_lift"]] > OFF_GROUND - RISE
    return Scene(vectors, measures, touches, touching, alignment.aligned, raised)
