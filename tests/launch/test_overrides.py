"""Values that are passed on to other recipes' command lines."""

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser

from tstar_rl.launch.overrides import quoted

PLAIN = ("runs/a-b.c", "", "a,b", "${x}", "a=b", "ü", "/o'disk (1)", "'")
BACKSLASHES = ("end\\", "two\\\\", "a\\'b", "\\\\'", "C:\\runs\\mine")


@pytest.mark.parametrize("text", [*PLAIN, *BACKSLASHES])
def test_hydra_reads_what_was_quoted(text):
    assert OverridesParser.create().parse_override(f"folder={quoted(text)}").value() == text
