"""Where the recipe brings the parts: each step turns a part on from how the step before left it."""

import pytest
import torch

from tstar_envs.furniture.schema import Connector, Furniture, Grasp, Part, Step
from tstar_envs.furniture.shapes import Box
from tstar_envs.tasks.recipe_tables import RecipeTables


def unit(generator: torch.Generator) -> tuple:
    quat = torch.randn(4, generator=generator, dtype=torch.float64)
    return tuple((quat / quat.norm()).tolist())


def chain(seed: int) -> Furniture:
    """Four parts turned at random: b is joined to a, c to b; then b, which has moved before, to d, with both on it."""
    generator, parts = torch.Generator().manual_seed(seed), []
    for i, name in enumerate("abcd"):
        ends = tuple(
            Connector(end, name, (0.0, 0.0, z), "end", "end", unit(generator))
            for end, z in (("low", -0.05), ("high", 0.05), ("middle", 0.0))
        )
        grasp, pose = Grasp((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)), (0.2 * i, 0.0, 0.05, *unit(generator))
        parts.append(Part(name, pose, (Box((0.02, 0.02, 0.05)),), 500.0, ends, (grasp,)))
    joins = (("b", "high", "a", "low"), ("c", "high", "b", "low"), ("b", "middle", "d", "low"))
    steps = tuple(Step(m, t, own, other, 0.0, (0.0, 0.0, 0.05)) for m, own, t, other in joins)
    return Furniture("chain", tuple(parts), steps, 0.05)


@pytest.mark.parametrize("seed", range(8))
def test_a_part_s_quaternion_goes_on_from_how_the_step_finds_it(seed):
    tables = RecipeTables(chain(seed), torch.device("cpu"))
    poses = tables.nominal_poses()
    for k in range(tables.num_steps):
        part = int(tables.moving[k])
        assert poses[k + 1, part, 3:] @ poses[k, part, 3:] > 0, f"step {k} turns the part the long way round"
