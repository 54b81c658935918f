"""Whether a piece of furniture is assembled, from where its parts are."""

import torch

from tstar_envs import geometry
from tstar_envs.furniture import load


def connector_gaps(task: str, bodies: dict) -> dict[str, float]:
    """Distance, m, between the two connectors of each step, from body poses as the page has them."""
    furniture, gaps = load(task), {}
    for k, step in enumerate(furniture.steps):
        ends = []
        connectors = furniture.connectors_of(k)
        for part, connector in zip((step.moving_part, step.target_part), connectors, strict=True):
            pose = torch.tensor(bodies[part], dtype=torch.float64)
            offset = torch.tensor(connector.pos, dtype=torch.float64)
            ends.append(pose[:3] + geometry.quat_rotate(pose[3:], offset))
        gaps[step.moving_part] = float((ends[0] - ends[1]).norm())
    return gaps
