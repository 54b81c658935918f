"""The relative features on poses worked by hand."""

import math

import pytest
import torch
from torch.testing import assert_close

from tstar_rl.models.relative_features import RelativeFeatures

HALF = math.sqrt(0.5)
IDENTITY = [1.0, 0.0, 0.0, 0.0]
TURN_Z = [HALF, 0.0, 0.0, HALF]  # 90 degrees: x -> y, y -> -x
TURN_X = [HALF, HALF, 0.0, 0.0]  # 90 degrees: y -> z, z -> -y


def about_z(degrees: float) -> list[float]:
    half = math.radians(degrees) / 2
    return [math.cos(half), 0.0, 0.0, math.sin(half)]


def description(**changes) -> dict:
    entries = {
        "moving_part": 1,
        "target_part": 4,
        "moving_connector": torch.tensor([0.0, 0.0, 0.1, *IDENTITY]),
        "target_connector": torch.tensor([0.3, 0.0, 0.0, *IDENTITY]),
        "grasp": torch.tensor([0.02, 0.0, 0.0, *IDENTITY]),
        "allowed_angles": torch.tensor([0.0]),
    }
    return {**entries, **changes}


def observation(
    grip=(0, 0, 0),
    hand=IDENTITY,
    moving=(0, 0, 0),
    moving_quat=IDENTITY,
    target=(0, 0, 0),
    target_quat=IDENTITY,
):
    obs = torch.zeros(72)
    obs[29:64].view(5, 7)[:, 3] = 1.0
    obs[16:19], obs[19:23] = torch.tensor(grip), torch.tensor(hand)
    obs[36:43] = torch.tensor([*moving, *moving_quat])  # part 1
    obs[57:64] = torch.tensor([*target, *target_quat])  # part 4
    return obs


def features_of(obs, **changes):
    return RelativeFeatures(description(**changes))(obs)


def test_errors_in_the_world_and_in_the_local_frames():
    # Moving part at (1, 0, 0), turned 90 degrees about z: its grasp point (0.02, 0, 0) is at (1, 0.02, 0), and the
    # grip at (1.01, 0.05, 0.02) is (0.01, 0.03, 0.02) from it. In the grasp frame (x is world y, y is world -x) that is
    # (0.03, -0.01, 0.02). Its connector (0, 0, 0.1) is at (1, 0, 0.1). The target part, at (0.9, 0, 0) and turned 90
    # degrees about x, has its connector (0.3, 0, 0) at (1.2, 0, 0): the error is (-0.2, 0, 0.1), and in the target's
    # frame (y is world z, z is world -y) it is (-0.2, 0.1, 0).
    out = features_of(
        observation(
            grip=(1.01, 0.05, 0.02),
            moving=(1, 0, 0),
            moving_quat=TURN_Z,
            target=(0.9, 0, 0),
            target_quat=TURN_X,
        )
    )
    errors = torch.tensor([0.01, 0.03, 0.02, -0.2, 0.0, 0.1, 0.03, -0.01, 0.02, -0.2, 0.1, 0.0])
    assert_close(out[20:32], errors / 0.25, atol=1e-5, rtol=0)
    assert_close(out[32:44], (errors / 0.05).tanh(), atol=1e-5, rtol=0)
    assert_close(out[44:56], (errors / 0.01).tanh(), atol=1e-4, rtol=0)


def test_cosines_of_the_axes():
    # The hand is turned 90 degrees about z and the moving part is not: columns are the hand's axes in the grasp frame.
    # The target is turned 90 degrees about x: in its frame the moving x is x, y is (0, 0, -1), z is (0, 1, 0).
    out = features_of(observation(hand=TURN_Z, target_quat=TURN_X))
    hand = torch.tensor([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    connector = torch.tensor([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    assert_close(out[:18], torch.cat((hand.flatten(), connector.flatten())), atol=1e-6, rtol=0)


def test_frames_inside_the_parts_count():
    # Grasp and connectors are turned in their parts just as the hand and the target are: every error is gone.
    out = features_of(
        observation(
            grip=(0, 0.02, 0), hand=TURN_Z, moving_quat=TURN_Z, target=(-0.3, 0, 0.1), target_quat=IDENTITY
        ),
        grasp=torch.tensor([0.02, 0, 0, *IDENTITY]),
        target_connector=torch.tensor([0.3, 0, 0, *TURN_Z]),
    )
    eye = torch.eye(3).flatten()
    assert_close(out[:18], torch.cat((eye, eye)), atol=1e-6, rtol=0)
    assert_close(out[18:20], torch.tensor([1.0, 0.0]), atol=1e-6, rtol=0)
    assert_close(out[20:56], torch.zeros(36), atol=2e-5, rtol=0)
    assert_close(out[59:65], torch.zeros(6), atol=2e-5, rtol=0)


@pytest.mark.parametrize(
    ("degrees", "allowed", "remaining"),
    [
        (10, [0], -10),
        (-10, [0], 10),
        (100, [0, 90, 180, 270], -10),
        (260, [0, 90, 180, 270], 10),
        (100, [0], -100),
    ],
)
def test_turn_to_the_nearest_allowed_angle(degrees, allowed, remaining):
    # A part turned by `degrees` about up needs `remaining` about up to come to the nearest allowed angle.
    out = features_of(
        observation(moving_quat=about_z(degrees)), allowed_angles=torch.tensor(allowed) * math.pi / 180
    )
    turn = math.radians(remaining)
    assert_close(out[18:20], torch.tensor([math.cos(turn), math.sin(turn)]), atol=1e-6, rtol=0)


def test_remaining_turns_of_the_connector():
    # The moving connector leans 10 degrees about the world's x; the target is turned by an allowed 90 degrees about z,
    # so that in its frame (x is world y, y is world -x) the turn of -10 degrees that remains is about +y.
    sine, half = math.sin(math.radians(10)), math.radians(5)
    leaning = [math.cos(half), math.sin(half), 0.0, 0.0]
    obs = observation(moving_quat=leaning, target_quat=about_z(90))
    out = features_of(obs, allowed_angles=torch.tensor([-math.pi / 2]))
    assert_close(out[18], torch.tensor(math.cos(math.radians(10))))
    assert_close(out[59:65], torch.tensor([-sine, 0.0, 0.0, 0.0, sine, 0.0]), atol=1e-6, rtol=0)
    assert_close(out[68:89], (torch.cat((out[56:68], out[:9])) / 0.1).tanh())


@pytest.mark.parametrize("degrees", [100, -80])
def test_remaining_turn_of_the_fingers(degrees):
    # The fingers close along the hand's y. At 90 or -90 degrees about z that is the grasp's x, either way round; 10
    # degrees further, a turn of -10 degrees about z remains: axis times sine times cosine, sin 20 / 2.
    out = features_of(observation(hand=about_z(degrees)))
    remaining = -math.sin(math.radians(20)) / 2
    assert_close(out[56:59], torch.tensor([0.0, 0.0, remaining]), atol=1e-6, rtol=0)
    assert_close(out[65:68], torch.tensor([0.0, 0.0, 1.0]), atol=1e-6, rtol=0)


def test_features_match_quaternion_algebra_on_random_poses():
    def rotate(q, v):
        w, u = q[..., :1], q[..., 1:]
        return v + 2 * torch.linalg.cross(u, torch.linalg.cross(u, v) + w * v)

    generator = torch.Generator().manual_seed(0)
    obs = torch.randn(4, 5, 72, generator=generator)
    for start in (19, 39, 60):
        obs[..., start : start + 4] /= obs[..., start : start + 4].norm(dim=-1, keepdim=True)
    pos, quat = torch.randn(2, 3, generator=generator), torch.randn(2, 4, generator=generator)
    quat = quat / quat.norm(dim=-1, keepdim=True)
    entries = description(
        moving_connector=torch.cat((pos[0], quat[0])), target_connector=torch.cat((pos[1], quat[1]))
    )
    out = RelativeFeatures(entries)(obs)
    moving = obs[..., 36:39] + rotate(obs[..., 39:43], pos[0].expand(4, 5, 3))
    target = obs[..., 57:60] + rotate(obs[..., 60:64], pos[1].expand(4, 5, 3))
    assert_close(out[..., 23:26] * 0.25, moving - target, atol=1e-5, rtol=1e-5)
    axis = torch.eye(3)[2].expand(4, 5, 3)
    up_moving = rotate(obs[..., 39:43], rotate(quat[0].expand(4, 5, 4), axis))
    up_target = rotate(obs[..., 60:64], rotate(quat[1].expand(4, 5, 4), axis))
    assert_close(out[..., 17], (up_moving * up_target).sum(-1), atol=1e-5, rtol=1e-5)
    # what remains to align the up axes, in the world, up to a turn about the target's up axis
    cross = torch.linalg.cross(up_moving, up_target)
    rest = out[..., 59:62] - cross
    assert_close(torch.linalg.cross(rest, up_target), torch.zeros(4, 5, 3), atol=1e-5, rtol=0)


def test_a_millimetre_is_seen():
    near = features_of(observation(moving=(0.3, 0, -0.1)))
    off = features_of(observation(moving=(0.301, 0, -0.1)))
    assert (off - near).abs().max() > 0.09


@pytest.mark.parametrize(
    ("changes", "message"),
    [({"grasp": torch.zeros(3)}, r"'grasp'.*\(7,\), got \(3,\)"), ({"grasp": None}, "lacks grasp")],
)
def test_wrong_features_are_named(changes, message):
    entries = {k: v for k, v in description(**changes).items() if v is not None}
    with pytest.raises(ValueError, match=message):
        RelativeFeatures(entries)
