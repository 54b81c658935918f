"""What the documentation names exists: links, headings, files, and the sections that docstrings name as source."""

import re
from pathlib import Path

import pytest

import tstar_envs
import tstar_rl

ROOT = Path(__file__).resolve().parents[1]
PAGES = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
HISTORY = ROOT / "CHANGELOG.md"  # names files as they were called at the time
CODE = [
    path
    for folder in ("envs", "tstar_rl", "recipes", "configs", "notebooks", "tests")
    for ending in ("py", "yaml", "ipynb")
    for path in (ROOT / folder).rglob(f"*.{ending}")
]
LINK = re.compile(r"\]\(([^)\s]+)\)|\b(?:src|href)=\"([^\"]+)\"")
PATH = re.compile(r"`((?:tstar_rl|envs|recipes|configs|tests|notebooks|docs)/[\w./-]*)`")
TEST = re.compile(r"`(test_\w+\.py)`")
SECTION = re.compile(r'docs/task\.md, "([^"]+)"(?: and "([^"]+)")?')
DOCUMENT = re.compile(r"\bdocs/[\w./-]+\.md\b|(?<=Source: )[\w./-]+\.md\b")


def ids(paths: list[Path]) -> list:
    return [pytest.param(path, id=str(path.relative_to(ROOT))) for path in sorted(paths)]


def prose(path: Path) -> str:
    """The page without its code blocks."""
    return re.sub(r"^```.*?^```", "", path.read_text(), flags=re.MULTILINE | re.DOTALL)


def headings(path: Path) -> list[str]:
    return re.findall(r"^#+ +(.+?) *$", prose(path), re.MULTILINE)


def anchor(heading: str) -> str:
    """The name by which GitHub and the site link to a heading."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def broken_links(path: Path) -> list[str]:
    """The relative links of a page that lead to no file, or to no heading of it."""
    broken = []
    for groups in LINK.findall(prose(path)):
        link = "".join(groups)
        if "://" in link or link.startswith("mailto:"):
            continue
        target, _, name = link.partition("#")
        there = path.parent / target if target else path
        known = not name or (there.is_file() and name in map(anchor, headings(there)))
        if not there.exists() or not known:
            broken.append(link)
    return broken


@pytest.mark.parametrize("path", ids(PAGES))
def test_every_relative_link_leads_somewhere(path):
    assert not broken_links(path)


def test_a_link_to_no_file_and_one_to_no_heading_are_found(tmp_path):
    (tmp_path / "other.md").write_text("# A heading, with `code`\n")
    page = tmp_path / "page.md"
    page.write_text(
        "[a](other.md#a-heading-with-code) [b](other.md#none) [c](none.md) [d](https://example.org) <img src='x'>\n"
        '<img src="none.png">\n```\n[e](code.md)\n```\n'
    )
    assert broken_links(page) == ["other.md#none", "none.md", "none.png"]


@pytest.mark.parametrize("path", ids([page for page in PAGES if page != HISTORY]))
def test_files_that_a_page_names_exist(path):
    text = path.read_text()
    assert not [name for name in PATH.findall(text) if not (ROOT / name).exists()]
    assert not [name for name in TEST.findall(text) if not list((ROOT / "tests").rglob(name))]


def test_documents_that_the_code_names_exist():
    missing = {
        f"{path.relative_to(ROOT)}: {name}"
        for path in CODE
        for name in DOCUMENT.findall(path.read_text())
        if not (ROOT / name).exists()
    }
    assert not missing


def test_sections_of_the_task_that_the_code_names_exist():
    known = headings(ROOT / "docs" / "task.md")
    named = {name for path in CODE for found in SECTION.findall(path.read_text()) for name in found if name}
    assert len(named) > 5  # else the pattern finds nothing, and the test says nothing
    assert not named - set(known)


def test_no_two_decisions_have_one_number():
    numbers = [path.name[:4] for path in (ROOT / "docs" / "decisions").glob("*.md")]
    assert len(set(numbers)) == len(numbers) > 0


def test_every_public_name_is_named():
    """In the section of docs/library.md, and no other: a name of another module is written with it."""
    section = (ROOT / "docs" / "library.md").read_text().split("## Public names")[1]
    world = {f"tstar_envs.{name}" for name in tstar_envs.__all__}
    assert set(re.findall(r"`([\w.]+)`", section)) == set(tstar_rl.__all__) | world
