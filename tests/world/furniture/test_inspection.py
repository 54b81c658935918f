"""What the check of a furniture file says: each broken value is named, in words that say what to do."""

import copy

import pytest
import yaml

from tstar_envs.furniture import library
from tstar_envs.inspection import inspect, try_out
from tstar_envs.inspection.trial import Trial
from tstar_envs.tasks.phase_reward import PHASES


@pytest.mark.parametrize("name", library.names())
def test_nothing_is_wrong_with_a_piece_of_the_library(name):
    assert not [str(finding) for finding in inspect(library.load(name)) if finding.wrong]


def _leg(data, **fields):
    data["parts"]["leg_2"].update(fields)


def _step(data, **fields):
    data["steps"][0].update(fields)


def _grasp_beside(data, off):
    """A grasp of 40 mm across a leg of 30 mm, `off` m beside its middle."""
    _leg(data, grasps=[{"left": [off - 0.02, 0, 0], "right": [off + 0.02, 0, 0]}])


def _second_top(data):
    """Two legs go onto another top."""
    top = copy.deepcopy(data["parts"]["table_top"])
    data["parts"]["other_top"] = top | {"initial_pose": [0.7, 0.3, 0.02, 0, 1, 0, 0]}
    for step in data["steps"][2:]:
        step["target_part"] = "other_top"


def _second_pegs(data):
    """A peg and a hole at the place of the first step's connectors, which no step names."""
    of_leg, of_top = (data["parts"][part]["connectors"] for part in ("leg_2", "table_top"))
    of_leg["peg"] = of_leg["top_end"] | {"kind": "peg", "mates_with": "hole"}
    of_top["hole"] = of_top["corner_2"] | {"kind": "hole", "mates_with": "peg"}


def _under_a_roof(data):
    """A short leg that would have to come through a plate over its corner."""
    _leg(data, boxes=[{"size": [0.015, 0.015, 0.02]}])
    data["parts"]["leg_2"]["connectors"]["top_end"]["pos"] = [0, 0, 0.02]
    data["parts"]["table_top"]["boxes"].append({"size": [0.03, 0.03, 0.005], "pos": [-0.305, 0.095, -0.1]})
    _step(data, insertion=0.15)


def _under_the_hand(data):
    """A corner of the top below the hand at home, on which a leg stands up into it."""
    data["parts"]["table_top"]["initial_pose"] = [0.305, 0.185, 0.02, 0, 1, 0, 0]


def _from_below(data):
    """A top that hangs 26 cm up, right side up: a leg that comes along the connectors' axis has 17 mm of floor."""
    data["parts"]["table_top"]["initial_pose"] = [-0.19, 0, 0.3, 1, 0, 0, 0]
    _step(data, approach="axis")


@pytest.mark.parametrize(
    ("change", "wrong", "where", "words"),
    [
        (lambda d: _leg(d, initial_pose=[-0.37, 0.31, -0.05, 0.5, 0.5, 0.5, 0.5]), True,
         "parts.leg_2.initial_pose", "65 mm in the floor"),
        (lambda d: _leg(d, initial_pose=[-0.37, 0.31, 0.2, 0.5, 0.5, 0.5, 0.5]), False,
         "parts.leg_2.initial_pose", "185 mm above the floor"),
        (lambda d: _leg(d, initial_pose=[-0.37, 0.22, 0.015, 0.5, 0.5, 0.5, 0.5]), True,
         "parts.leg_3.initial_pose", "20 mm inside leg_2"),
        (lambda d: _leg(d, initial_pose=[-0.37, 0.25, 0.015, 0.5, 0.5, 0.5, 0.5]), False,
         "parts.leg_3.initial_pose", "10 mm from leg_2"),
        (lambda d: _leg(d, initial_pose=[0, 0.09, 0.2, 0.5, 0.5, 0.5, 0.5]), True,
         "parts.leg_2.initial_pose", "from the hand at home"),
        (lambda d: _leg(d, boxes=[{"size": [0.05, 0.05, 0.13]}]), True, "steps[0].grasp", "100 mm wide"),
        (lambda d: _leg(d, boxes=[{"size": [0.006, 0.006, 0.13]}]), True, "steps[0].grasp", "12 mm wide"),
        (lambda d: _leg(d, boxes=[{"size": [0.008, 0.008, 0.13]}]), False, "steps[0].grasp", "hardly press"),
        (lambda d: _leg(d, initial_pose=d["parts"]["leg_3"]["initial_pose"]), True,
         "parts.leg_3.initial_pose", "30 mm inside leg_2"),  # with the same centre: MuJoCo itself says 0
        (lambda d: _leg(d, boxes=[{"size": [0.15, 0.015, 0.13]}]), True, "steps[0].grasp", "wider than 200 mm"),
        (lambda d: d["parts"]["table_top"]["connectors"]["corner_2"].update(allowed_degrees=[0, 45]), False,
         "parts.table_top.connectors.corner_2.allowed_degrees", "it does not count in steps[0]: there those of"),
        (lambda d: _leg(d, grasps=[{"left": [-0.02, 0, 0.3], "right": [0.02, 0, 0.3]}]), True,
         "steps[0].grasp", "nothing of leg_2 is between the fingers"),
        (lambda d: _leg(d, grasps=[{"left": [0, 0, 0], "right": [0.04, 0, 0]}]), False,
         "steps[0].grasp", "20 mm off the middle"),
        (lambda d: _grasp_beside(d, 0.028), False, "steps[0].grasp", "28 mm off the middle"),
        (lambda d: _grasp_beside(d, 0.04), True, "steps[0].grasp",
         "a finger comes down on leg_2, whose middle is 40 mm off the grasp's"),
        (lambda d: _grasp_beside(d, -0.07), True, "steps[0].grasp",
         "nothing of leg_2 is between the fingers there: it is 70 mm beside their middle"),
        (lambda d: _leg(d, grasps=[{"left": [0, -0.02, 0], "right": [0, 0.02, 0]}]), True,
         "steps[0].grasp", "close along the direction in which the hand comes"),
        (lambda d: _leg(d, initial_pose=[-1.5, 0.3, 0.015, 0.5, 0.5, 0.5, 0.5]), True,
         "steps[0]", "to grasp leg_2 the hand must be where the arm does not reach"),
        (lambda d: d["parts"]["table_top"].update(initial_pose=[-0.19, -1.2, 0.02, 0, 1, 0, 0]), True,
         "steps[0]", "to join leg_2 the hand must be where the arm does not reach"),
        (lambda d: d["parts"]["table_top"]["connectors"]["corner_2"].update(pos=[-0.305, 0.095, 0]), True,
         "steps[0]", "leg_2 is 20.0 mm inside table_top when the connectors meet"),
        (lambda d: d["parts"]["leg_2"]["connectors"]["top_end"].update(pos=[0, 0, 0.2]), False,
         "parts.leg_2.connectors.top_end.pos", "floats 69 mm off"),
        (_under_a_roof, True, "steps[0]", "leg_2 would go through table_top"),
        (_under_the_hand, True, "steps[0]", "leg_2 is where the hand is put home after the step"),
        (_from_below, True, "steps[0]", "leg_2 would go through the floor 20 mm before the connectors meet"),
        (_second_pegs, False, "steps[0]", "leg_2.peg and table_top.hole meet there, too, and are no step's"),
        (lambda d: _leg(d, boxes=[{"size": [0.1, 0.015, 0.13], "pos": [0.05, 0, 0]}]), True,
         "steps[0].grasp", "nothing of leg_2 is between the fingers there, or it is wider than 200 mm"),
        (lambda d: _leg(d, density=20000, boxes=[{"size": [0.017, 0.017, 0.13]}]), True,
         "steps[0]", "leg_2 and what is joined to it weigh 6.01 kg"),
        (lambda d: _leg(d, density=1), False, "parts.leg_2.density", "weighs 0.236 g"),
        (lambda d: _step(d, waypoint=[2, 2, 2]), False, "steps[0].waypoint", "to lift leg_2 there the hand must be"),
        (lambda d: _step(d, waypoint=[0, 0, -1]), False, "steps[0].waypoint", "to lift leg_2 to below where it lay"),
        (lambda d: _step(d, waypoint=[0, 0, 0]), False, "steps[0].waypoint", "by nothing"),
        (lambda d: _step(d, waypoint=[0.03, 0.03, 0.015]), False, "steps[0].waypoint", "less than 20 mm up and 50 mm"),
        (lambda d: _step(d, insertion=0.06), False, "z_finedist", "50 mm above its target leg_2 is inside it"),
        (lambda d: _step(d, insertion=0.02, clearance=0.002), False, "steps[0].clearance", "2 mm of play"),
        (lambda d: _step(d, clearance=0.03), False, "steps[0].clearance", "it does not count without insertion"),
        (lambda d: _step(d, grasp_from="back", grip_angle=[0, -1, 0], travel_height=0.3), False,
         "steps[0].travel_height", "does not count where the hand comes from behind"),
        (lambda d: d["steps"].pop(), False, "parts.leg_1", "no step joins it"),
        (_second_top, False, "steps",
         "they leave 2 pieces that no step joins: other_top, leg_4, leg_1; table_top, leg_2, leg_3"),
    ],
)  # fmt: skip
def test_a_broken_value_is_named(table, change, wrong, where, words):
    found = inspect(library.read(table(change)))
    said = [f for f in found if f.where == where and words in f.text]
    assert said and said[0].wrong == wrong, [str(f) for f in found]


def test_another_bar_beside_the_fingers_is_not_between_them(table):
    """A leg with a second bar, which begins 5 cm beside the middle of the first: the open fingers come down between."""
    bars = [{"size": [0.015, 0.015, 0.13]}, {"size": [0.01, 0.015, 0.03], "pos": [0.06, 0, 0]}]
    change = {"boxes": bars, "grasps": [{"left": [-0.02, 0, 0], "right": [0.02, 0, 0]}]}
    found = inspect(library.read(table(lambda d: _leg(d, **change))))
    assert not [f for f in found if f.where == "steps[0].grasp"], [str(f) for f in found]


def test_a_light_part_that_carries_the_rest_needs_stiffer_contacts(tmp_path):
    data = yaml.safe_load((library.DATA / "chair_ingolf.yaml").read_text())
    del data["contact_impedance"]
    (tmp_path / "soft.yaml").write_text(yaml.safe_dump(data, sort_keys=False))
    found = [f for f in inspect(library.read(tmp_path / "soft.yaml")) if f.where == "contact_impedance"]
    assert found and "left_side of 12 g carries" in found[0].text


def test_a_heavy_part_that_nobody_lifts_is_in_order(table):
    found = inspect(library.read(table(lambda d: d["parts"]["table_top"].update(density=10000))))
    assert not [finding for finding in found if "weigh" in finding.text]


def test_parts_that_pass_through_each_other_may_lie_in_each_other(table):
    there = {"initial_pose": [-0.37, 0.27, 0.015, 0.5, 0.5, 0.5, 0.5]}

    def start(free: bool) -> list[str]:
        def change(data):
            _leg(data, **there)
            data["no_contact"] = [["leg_2", "leg_3"]] if free else []

        where = "parts.leg_3.initial_pose"
        return [f.text for f in inspect(library.read(table(change))) if f.where == where]

    assert start(free=False) and not start(free=True)


def test_a_capsule_through_a_box_is_in_it(table):
    """Here MuJoCo's distance is 10 mm; 1 mm further aside it is -10."""

    def rod_in_a_plate(data):
        plate, rod = ([0.2, 0.6, 0.0205, 1, 0, 0, 0], [0.16, 0.57, 0.0205, 0.5**0.5, 0.5**0.5, 0, 0])
        data["parts"]["leg_3"].update(boxes=[{"size": [0.1, 0.05, 0.02]}], initial_pose=plate)
        del data["parts"]["leg_2"]["boxes"]
        _leg(data, capsules=[{"radius": 0.01, "half_length": 0.1}], initial_pose=rod)

    found = inspect(library.read(table(rod_in_a_plate)))
    assert "it starts 10 mm inside leg_2" in [f.text for f in found if f.where == "parts.leg_3.initial_pose"]


def test_the_script_says_how_it_fails(table):
    trial = try_out(library.read(table()), 0, episodes=4)
    assert trial.success == 1.0 and str(trial).startswith("steps[0]: 100% of 4, in ")
    assert trial.phase == "move_leg_fine" and str(trial).endswith("control steps")
    beside = {"left": [-0.02, 0, 0.3], "right": [0.02, 0, 0.3]}
    trial = try_out(library.read(table(lambda d: _leg(d, grasps=[beside]))), 0, episodes=2)
    assert trial.success == 0.0 and trial.failures == "2 never had the part between both fingers"
    assert str(trial) == "steps[0]: 0% of 2; 2 never had the part between both fingers"


def test_the_script_says_at_which_step_a_whole_piece_fails(table):
    """The first leg is joined; the second is never touched, so it is not the first that was lost."""
    beside = {"left": [-0.02, 0, 0.3], "right": [0.02, 0, 0.3]}

    def change(data):
        data["parts"]["leg_3"]["grasps"] = [beside]

    trial = try_out(library.read(table(change)), None, episodes=2)
    assert trial.failures == "2 never had the part between both fingers, most at steps[1]"


def test_a_long_step_is_named():
    trial = Trial(0, 4, 1.0, 120.5, "", PHASES[-1], False)
    assert "more than 120" in str(trial) and "more than" not in str(trial._replace(length=120.0))
    assert "more than" not in str(trial._replace(step=None))


def test_a_lift_point_that_the_script_does_not_come_by_is_named(table):
    trial = try_out(library.read(table(lambda d: _step(d, waypoint=[0, 0, 0.5]))), 0, episodes=4)
    assert trial.success == 1.0 and trial.phase == "lift_leg"
    assert str(trial).endswith(
        "never ends the reward's phase lift_leg, so that no later one pays (is the waypoint on its way?)"
    )


def test_half_a_turn_the_other_way_round_is_named(tmp_path):
    data = yaml.safe_load((library.DATA / "table_dockstra.yaml").read_text())
    assert data["steps"][1]["degrees"] == -180
    data["steps"][1]["degrees"] = 180
    (tmp_path / "turned.yaml").write_text(yaml.safe_dump(data, sort_keys=False))
    trial = try_out(library.read(tmp_path / "turned.yaml"), 1, episodes=2)
    assert trial.success == 1.0 and trial.other_way and "write degrees: -180" in str(trial)


@pytest.mark.slow
@pytest.mark.parametrize("name", library.names())
def test_parts_come_round_as_starts_at_the_next_step_suppose(name):
    furniture = library.load(name)
    for step in range(len(furniture.steps) - 1):
        trial = try_out(furniture, step, episodes=4)
        assert trial.success > 0 and not trial.other_way, str(trial)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted({*library.names()} - {"chair_ingolf"}))
def test_the_script_comes_by_the_lift_points_of_the_library(name):
    """Not so of chair_ingolf, which has the original's: docs/furniture_shelf.md."""
    furniture = library.load(name)
    for step in range(len(furniture.steps)):
        trial = try_out(furniture, step, episodes=4)
        assert trial.phase == "move_leg_fine", str(trial)
