"""Where things stand in an observation: the robot, 7 numbers a part, the phase.

Source: docs/task.md, "Observation".
"""

JOINTS = 7  # angles in rad, the first numbers of an observation
GRIP_POSITION, HAND_QUAT, PARTS = 16, 19, 29  # where they begin in an observation; a part is 7 numbers
NUM_PHASES = 8  # the one-hot phase ends an observation
FINGERS = 1  # they close along the hand's y axis


def observation_size(parts: int) -> int:
    """Numbers in an observation of furniture with `parts` parts."""
    return PARTS + 7 * parts + NUM_PHASES
