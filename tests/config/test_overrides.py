"""Values of a command line: what they are of, and how they are passed on to another recipe."""

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser

from tstar_rl.config.overrides import key_of, quoted, section_of

PLAIN = ("runs/a-b.c", "", "a,b", "${x}", "a=b", "ü", "/o'disk (1)", "'")
BACKSLASHES = ("end\\", "two\\\\", "a\\'b", "\\\\'", "C:\\runs\\mine")


@pytest.mark.parametrize("text", [*PLAIN, *BACKSLASHES])
def test_hydra_reads_what_was_quoted(text):
    assert OverridesParser.create().parse_override(f"folder={quoted(text)}").value() == text


@pytest.mark.parametrize(
    ("value", "key", "section"),
    [
        ("seed=3", "seed", "seed"),
        ("+env.snap=true", "env.snap", "env"),
        ("++chain.ppo.learning_rate=1e-5", "chain.ppo.learning_rate", "chain"),
        ("evaluation={episodes: 2}", "evaluation", "evaluation"),
        ("path=a=b.c", "path", "path"),
        ("~bonus", "bonus", "bonus"),
    ],
)
def test_what_a_value_is_of(value, key, section):
    assert (key_of(value), section_of(value)) == (key, section)
