"""Checks of the steps of a piece: the grasp of each, what is in a part's way, what it weighs, what else would meet."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import torch

from tstar_envs import geometry
from tstar_envs.connection import WrongPairs
from tstar_envs.furniture.schema import Step
from tstar_envs.inspection.finding import Finding, doubtful, wrong
from tstar_envs.inspection.grasp_checks import grasp_findings
from tstar_envs.inspection.workshop import Workshop
from tstar_envs.tasks.phase_reward import CONDITIONS

MOST_MASS = 5.0
"""kg: what is heavier slips out of the grip."""
INSIDE, ON_THE_WAY = 0.0005, 0.002
"""m: how deep joined parts may be in each other, and how deep on the way there."""
_LOOK_AHEAD = 0.03
_LIFTED = {
    condition[0]: condition[2] for condition in CONDITIONS["lift_leg"] if not isinstance(condition, str)
}
"""m: what counts as lifted, nearer than this to the lift point in height and in the plane."""


def assembly_findings(workshop: Workshop) -> Iterator[Finding]:
    """Everything about the steps, in their order."""
    wrong_pairs = WrongPairs(workshop.furniture, torch.device("cpu"))
    for step in range(len(workshop.furniture.steps)):
        yield from grasp_findings(workshop, step)
        yield from _way_in(workshop, step)
        yield from _values(workshop, step)
        yield from _twins(workshop, step, wrong_pairs)


def _way_in(workshop: Workshop, k: int) -> Iterator[Finding]:
    """Whether the moving parts can be where they are joined, and come there in a straight line."""
    step, names = workshop.furniture.steps[k], workshop.furniture.part_names
    group = workshop.group(k)
    others = [i for i in range(len(names)) if i not in group]
    free = {frozenset(pair) for pair in workshop.furniture.no_contact}
    pairs = [(i, j) for i in group for j in others if frozenset((names[i], names[j])) not in free]
    after = workshop.nominal[k + 1]
    workshop.place(after)
    in_floor = {i: -workshop.lowest(i) for i in group}
    for i in group:
        if in_floor[i] > INSIDE:
            depth = 1000 * in_floor[i]
            yield wrong(f"steps[{k}]", f"{names[i]} is {depth:.0f} mm in the floor when the connectors meet")
        if k + 1 < len(workshop.furniture.steps) and workshop.gap_to_hand(i) < 0:
            yield wrong(
                f"steps[{k}]",
                f"{names[i]} is where the hand is put home after the step: move the target away from (0, 0.09)",
            )
    inside = {(i, j): -workshop.gap(i, j) for i, j in pairs}
    for (i, j), depth in inside.items():
        if depth > INSIDE:
            yield wrong(
                f"steps[{k}]",
                f"{names[i]} is {1000 * depth:.1f} mm inside {names[j]} when the connectors meet: leave a gap",
            )
    out = _way_out(workshop, k)
    for back in np.arange(0.005, step.insertion + _LOOK_AHEAD, 0.005):
        poses = after.copy()
        poses[group, :3] += back * out
        workshop.place(poses)
        hits = [(i, names[j]) for i, j in pairs if -workshop.gap(i, j) > max(ON_THE_WAY, inside[i, j])]
        hits += [(i, "the floor") for i in group if -workshop.lowest(i) > max(ON_THE_WAY, in_floor[i])]
        if hits:
            i, what = hits[0]
            yield wrong(
                f"steps[{k}]",
                f"{names[i]} would go through {what} {1000 * back:.0f} mm before the connectors meet "
                f"(approach: {step.approach})",
            )
            return


def _values(workshop: Workshop, k: int) -> Iterator[Finding]:
    step, furniture = workshop.furniture.steps[k], workshop.furniture
    masses = {i: workshop.mass(i) for i in workshop.group(k)}
    moving = furniture.part_index(step.moving_part)
    if sum(masses.values()) > 2.5 * masses[moving] and furniture.contact_impedance is None:
        yield doubtful(
            "contact_impedance",
            f"{step.moving_part} of {1000 * masses[moving]:.0f} g carries {1000 * sum(masses.values()):.0f} g in "
            f"steps[{k}]: MuJoCo's own is too soft for that, see docs/furniture.md",
        )
    if (carried := sum(masses.values())) > MOST_MASS:
        yield wrong(
            f"steps[{k}]",
            f"{step.moving_part} and what is joined to it weigh {carried:.3g} kg, the hand lifts {MOST_MASS:g} kg: "
            f"give the parts a smaller density, or move the other part",
        )
    if step.insertion > 0 and step.clearance < 0.006:
        yield doubtful(
            f"steps[{k}].clearance",
            f"{1000 * step.clearance:.0f} mm of play: the script misses less than 6 mm, a learned skill less than 10",
        )
    moving_connector, target_connector = furniture.connectors_of(k)
    if moving_connector.allowed_angles != target_connector.allowed_angles:
        yield doubtful(
            f"parts.{step.target_part}.connectors.{target_connector.name}.allowed_degrees",
            f"it does not count in steps[{k}]: there those of the moving part's {moving_connector.name} do, "
            f"which are others",
        )
    if step.grasp_from == "back" and step.grip_angle[2] > -0.99 and step.travel_height != Step.travel_height:
        yield doubtful(
            f"steps[{k}].travel_height",
            "its height does not count where the hand comes from behind (grasp_from: back)",
        )
    if step.insertion == 0 and step.clearance != Step.clearance:
        yield doubtful(f"steps[{k}].clearance", "it does not count without insertion")
    (x, y, z), up, aside = step.waypoint, _LIFTED["part_to_lift_height"], _LIFTED["part_to_lift_plane"]
    if abs(z) < up and math.hypot(x, y) < aside:
        yield doubtful(
            f"steps[{k}].waypoint",
            f"the reward asks the hand to lift the part by nothing: less than {1000 * up:.0f} mm up and "
            f"{1000 * aside:.0f} mm aside counts as there",
        )
    if step.insertion > furniture.z_finedist:
        yield doubtful(
            "z_finedist",
            f"{1000 * furniture.z_finedist:.0f} mm above its target {step.moving_part} is inside it already, by "
            f"steps[{k}].insertion: the reward pays for coming there from any side",
        )


def _way_out(workshop: Workshop, k: int) -> np.ndarray:
    target = torch.as_tensor(workshop.nominal[k][int(workshop.tables.target[k]), 3:])
    frame = geometry.quat_to_matrix(target).unsqueeze(0)
    return workshop.tables.approach_direction(torch.tensor([k]), frame)[0].numpy()


def _twins(workshop: Workshop, k: int, wrong_pairs: WrongPairs) -> Iterator[Finding]:
    """Other connectors that meet when the step's own do: whoever asks to connect a little early fails by them."""
    poses = torch.from_numpy(workshop.nominal[k + 1]).unsqueeze(0)
    held = torch.zeros(1, poses.shape[1], dtype=torch.bool)
    held[0, workshop.group(k)] = True
    which = wrong_pairs.which(poses, held, torch.tensor([k]))[0].nonzero().flatten()
    met = {frozenset(wrong_pairs.pairs[i]) for i in which}
    for one, other in sorted(map(sorted, met)):
        yield doubtful(
            f"steps[{k}]",
            f"{one} and {other} meet there, too, and are no step's: to connect by them is a wrong connection, which "
            "fails the episode. Leave one of them out",
        )
