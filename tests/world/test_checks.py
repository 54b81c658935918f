"""What a message shows of a value is short, whatever the value is."""

import time

import pytest

from tstar_envs.checks import short
from tstar_envs.furniture import library
from tstar_envs.furniture.errors import FurnitureError


def nested(levels: int) -> str:
    """A file of YAML in which each line has the one before nine times: 9**levels items in all."""
    lines = ["a0: &a0 [1, 1]"]
    lines += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]" for k in range(1, levels)]
    return "\n".join([*lines, f"parts: *a{levels - 1}"]) + "\n"


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (3, "3"),
        ("a" * 20, repr("a" * 20)),
        ([1, [2, 3]], "[1, [2, 3]]"),
    ],
)
def test_what_is_short_is_shown_as_it_is(value, shown):
    assert short(value) == shown


def test_a_number_that_python_does_not_print_is_told_as_one():
    assert short(10**5000) == "a very long number"


def test_a_file_that_holds_more_than_memory_does_is_refused_at_once(tmp_path):
    (tmp_path / "bomb.yaml").write_text(nested(30))
    begun = time.monotonic()
    with pytest.raises(FurnitureError, match="bomb"):
        library.read(tmp_path / "bomb.yaml")
    assert time.monotonic() - begun < 30  # printed whole it would take longer than the universe lasts
