"""docs/task.md says what the code does: its tables are read and compared with the constants and settings."""

import dataclasses
import math
import re
from pathlib import Path

import pytest

from tstar_envs import connection, scene
from tstar_envs.environment import NUM_OBSERVATIONS_ROBOT
from tstar_envs.experts import assembler
from tstar_envs.furniture import library
from tstar_envs.robots import sawyer
from tstar_envs.settings import TaskSettings
from tstar_envs.tasks import assembly, measures, phase_reward, scene_reader

PAGE = (Path(__file__).resolve().parents[1] / "docs" / "task.md").read_text()
FLAT = " ".join(PAGE.split())


def section(title: str) -> str:
    """The text below a heading, up to the next one."""
    return re.split(rf"^#+ {re.escape(title)}$", PAGE, flags=re.MULTILINE)[1].split("\n#")[0]


def rows(title: str) -> list[list[str]]:
    """The cells of a section's first table, row by row."""
    lines = [line.strip("| ") for line in section(title).splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.split(" | ")] for line in lines[2:]]


def numbers(text: str) -> tuple[float, ...]:
    return tuple(float(found) for found in re.findall(r"-?\d+(?:\.\d+)?(?:e-?\d+)?", text))


def coefficients(potential: str) -> list[float]:
    """Of its summands, with their signs, in order: "-5 exp(-2 d) + 3 (a + b)" has -5 and 3."""
    joined = re.sub(r"([+-]) (?=\d)", r"\1", potential)
    return [float(found) for found in re.findall(r"(?<!\S)[+-]?\d+(?= (?:exp|min|)\()", joined)]


def test_the_scene():
    table = {first: rest for first, *rest in rows("Scene")}
    assert numbers(table["home pose of the arm"][0]) == sawyer.HOME_QPOS
    assert numbers(table["joint speed limits"][0]) == sawyer.JOINT_SPEEDS
    assert numbers(table["robot base"][0]) == (*sawyer.BASE_POS, -90)
    opened, closed, _ = numbers(table["fingers, each"][0])
    assert (opened, closed) == pytest.approx(
        [1000 * sawyer.FINGER_OPEN[0], 1000 * sawyer.FINGER_CLOSED[0]], abs=0.1
    )
    assert numbers(table["control"][0])[1:3] == (scene.SUBSTEPS, 1000 * scene.TIMESTEP)


def test_the_observation_adds_up():
    sizes = [int(size) for size, _ in rows("Observation") if size.isdigit()]
    phases = len(phase_reward.PHASES)
    assert (sum(sizes[:-1]), sizes[-1]) == (NUM_OBSERVATIONS_ROBOT, phases)
    assert f"`{NUM_OBSERVATIONS_ROBOT} + 7 M + {phases}`" in PAGE


@pytest.mark.parametrize(
    ("words", "value"),
    [
        (r"\[-2, 2\] cm in x and y \(`part_noise`\)", TaskSettings.part_noise == 0.02),
        (r"\[-3, 3\] degrees in yaw \(`part_noise_degrees`\)", TaskSettings.part_noise_degrees == 3),
        (r"up to 12 mm in each direction \(`jitter`\)", TaskSettings.jitter == 0.012),
        (r"up to 5 degrees about a random axis \(`jitter_degrees`\)", TaskSettings.jitter_degrees == 5),
        (r"1 cm above where they were put \(`drop_height`\)", TaskSettings.drop_height == 0.01),
        (r"30 physics steps, 0.3 s \(`settle_steps`\)", TaskSettings.settle_steps == 30),
        (r"\[-1e-3, 1e-3\] rad \(`arm_noise`\)", TaskSettings.arm_noise == 1e-3),
        (r"200 control steps for one subtask, 200 K for the whole task \(`max_steps`\)", TaskSettings.max_steps == 200),
        (r"moved by more than 0.1 m", assembly.DISTURBED == 0.1),
        (r"less than 2 cm apart", connection.MAX_DISTANCE == 0.02),
        (r"up axes is above 0.99", connection.MIN_UP_COSINE == 0.99),
        (r"forward axes is above 0.99", connection.MIN_FORWARD_COSINE == 0.99),
        (r"at most 0.4 m/s and 1.4 rad/s", (assembler.MAX_SPEED, assembler.MAX_TURN) == (0.4, 1.4)),
        (r"within a cosine of 0.95", phase_reward.MIN_GRIP_COSINE == 0.95),
        (r"5 cm above the grasp point", measures.ABOVE == 0.05),
        (r"1.5 cm below the grasp point", measures.BELOW == 0.015),
        (r"when the part is 1 cm above where it lay", scene_reader.OFF_GROUND == 0.01),
    ],
)  # fmt: skip
def test_a_figure_is_on_the_page_and_in_the_code(words, value):
    assert re.search(words, FLAT)
    assert value


def test_the_phases_and_their_bonuses():
    table = rows("The phases")
    assert [cells[1].strip("`") for cells in table] == list(phase_reward.PHASES)
    bonuses = [float(cells[-1].replace(",", "")) for cells in table]
    assert bonuses == [phase_reward.BONUS * share for share in phase_reward.BONUS_SHARES]


@pytest.mark.parametrize("phase", phase_reward.PHASES)
def test_the_numbers_of_a_phase(phase):
    found = {row[1].strip("`"): row for row in rows("The phases")}
    _, _, potential, condition, _ = found["lower_eef" if phase == "grasp_leg" else phase]
    summands = phase_reward.POTENTIALS[phase]
    terms = [term for _, *some in summands for term in some]
    written = {abs(number) for number in numbers(potential)}
    assert coefficients(potential) == [coefficient for coefficient, *_ in summands]
    assert {term.rate for term in terms if term.rate} <= written
    assert {term.most for term in terms if math.isfinite(term.most)} <= written
    bounds = [bound for bound in phase_reward.CONDITIONS[phase] if not isinstance(bound, str)]
    limits = {limit for _, *both in bounds for limit in both if math.isfinite(limit) and limit}
    limits -= {phase_reward.MIN_GRIP_COSINE}  # "down" and "gripping" on the page
    if phase != "grasp_leg":
        known = {number for found in numbers(condition) for number in (found, found / 100)}  # cm
        assert all(any(math.isclose(limit, number) for number in known) for limit in limits)


def test_settings_that_the_page_names_exist():
    known = {field.name for field in dataclasses.fields(TaskSettings)}
    named = set(re.findall(r"`([a-z_]+): [a-z.\d]+`", PAGE))
    assert len(named) > 5
    assert not named - known


def test_densities_and_rotations_of_the_table():
    table = library.load("table_lack")
    leg, top = table.part("leg_1"), table.part("table_top")
    assert f"legs {leg.density:g}, top {top.density:g}" in PAGE
    size = leg.boxes[0].size
    assert f"a leg weighs {8000 * leg.density * size[0] * size[1] * size[2]:.0f} g" in PAGE
    degrees = [round(step.angle * 180 / 3.141592653589793) for step in table.steps]
    assert f"{', '.join(map(str, degrees))} degrees in the script" in PAGE
