"""What the site shows beside the files below docs/: README, notebooks, recipes, API reference; and its navigation.

MkDocs calls the functions whose names begin with `on_` (mkdocs.yml, `hooks`). Nothing here is imported by the library.
"""

import ast
import os
import re
from collections.abc import Iterator
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.plugins import event_priority
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = {"tstar_rl": ROOT / "tstar_rl", "tstar_envs": ROOT / "envs" / "tstar_envs"}
COPIED = {"README.md": "index.md", "CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}
FIRST = ("usage.md", "watch.md", "library.md", "method.md", "task.md", "notation.md", "results.md")
"""Pages of docs/ that the navigation names first, in this order."""
LAST = ("every_run.md",)
"""Pages of docs/ that it names after all others."""
NOT_SHOWN = ("results_notes.md",)
LINK = re.compile(
    r"(?P<head>!?\[[^\]]*\]\(|\bsrc=\")(?P<target>[^)\"\s#]+)(?P<tail>#[^)\"\s]*)?(?P<end>\)|\")"
)


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Sets the navigation: new pages, decisions, notebooks and modules appear in it by themselves."""
    pages = {path.name for path in (ROOT / "docs").glob("*.md")} - set(NOT_SHOWN)
    folders = [
        {folder.name.capitalize(): [f"{folder.name}/{name}" for name in in_order(folder)]}
        for folder in sorted((ROOT / "docs").iterdir())
        if folder.is_dir() and folder.name != "decisions" and any(folder.glob("*.md"))
    ]
    decisions = sorted(f"decisions/{path.name}" for path in (ROOT / "docs/decisions").glob("*.md"))
    config.nav = [
        {"Home": "index.md"},
        *[name for name in FIRST if name in pages],
        *sorted(pages - {*FIRST, *LAST}),
        *folders,
        {"Decisions": ["decisions/index.md", *decisions]},
        {"Notebooks": [f"notebooks/{path.name}" for path in notebooks()]},
        {"Recipes": "recipes.md"},
        *[name for name in LAST if name in pages],
        {"Reference": [{name: [uri for uri, _ in reference(name)]} for name in PACKAGES]},
        {"Contributing": "contributing.md"},
        {"Changelog": "changelog.md"},
    ]
    return config


@event_priority(100)  # before the plugin that renders notebooks
def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Adds the pages that are not files below docs/."""
    for source, uri in COPIED.items():
        files.append(File.generated(config, uri, abs_src_path=str(ROOT / source)))
    for path in notebooks():
        uri = f"notebooks/{path.name}"
        files.append(File(uri, str(ROOT), config.site_dir, config.use_directory_urls))
    texts = {"decisions/index.md": decision_index(), "recipes.md": recipe_page()}
    for name in PACKAGES:
        texts.update(reference(name))
    for uri, text in texts.items():
        files.append(File.generated(config, uri, content=text))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Turns links between files of the repository into links between pages.

    A file of the repository that is no page loses its link and keeps its text. What is no file at all is left as it
    is, and MkDocs reports it.
    """
    source = page.file.abs_src_path
    if source is None or not source.endswith(".md"):
        return markdown
    shown = {str(ROOT / name): uri for name, uri in COPIED.items()}
    shown |= {str(path): f"notebooks/{path.name}" for path in notebooks()}
    shown |= {str(ROOT / "docs/decisions"): "decisions/index.md", str(ROOT / "recipes"): "recipes.md"}
    shown[str(ROOT / "docs/experiments")] = "experiments/index.md"
    shown |= {str(path): "recipes.md" for path in (ROOT / "recipes").glob("*.py")}
    shown |= {str(ROOT / "docs" / file.src_uri): file.src_uri for file in files}

    def relink(match: re.Match) -> str:
        target = match["target"]
        if "://" in target or target.startswith("mailto:"):
            return match.group()
        path = os.path.normpath(Path(source).parent / target)
        if path in shown:
            there = os.path.relpath(shown[path], Path(page.file.src_uri).parent)
            return f"{match['head']}{there}{match['tail'] or ''}{match['end']}"
        text = re.match(r"\[([^\]]*)\]", match.group())
        return text[1] if text and Path(path).exists() else match.group()

    return LINK.sub(relink, markdown)


def on_page_content(html: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Turns links of notebooks to docs/*.md into links to its pages, which lie beside the notebooks' folder there."""
    if not page.file.src_uri.endswith(".ipynb"):
        return html
    return re.sub(r'href="\.\./docs/([^"#]+)\.md', r'href="../\1.html', html)


def in_order(folder: Path) -> list[str]:
    """The pages of a folder, the one that presents it first."""
    return sorted((path.name for path in folder.glob("*.md")), key=lambda name: (name != "index.md", name))


def notebooks() -> list[Path]:
    """The notebooks, the first steps first, then in the order of their names."""
    return sorted(
        (ROOT / "notebooks").glob("*.ipynb"), key=lambda path: (path.stem != "first_steps", path.name)
    )


def decision_index() -> str:
    """A page that lists the decisions by their titles."""
    lines = [
        "# Decisions",
        "",
        "Why things are as they are: what was decided, why, and what was measured.",
        "",
    ]
    for path in sorted((ROOT / "docs/decisions").glob("*.md")):
        lines.append(f"- [{path.read_text().splitlines()[0].removeprefix('# ')}]({path.name})")
    return "\n".join(lines)


def recipe_page() -> str:
    """A page with the description and the source of every recipe."""
    lines = ["# Recipes", "", "Scripts, run by path. Each is one algorithm, or one step of the pipeline.", ""]
    for path in sorted((ROOT / "recipes").glob("*.py")):
        source = path.read_text()
        words = (ast.get_docstring(ast.parse(source)) or "").splitlines()
        code = "\n".join(f"    {line}".rstrip() for line in source.splitlines())
        lines += [f"## {path.stem}", "", words[0] if words else "", ""]
        lines += [f'??? note "recipes/{path.name}"', "", "    ```python", code, "    ```", ""]
    return "\n".join(lines)


def reference(package: str) -> Iterator[tuple[str, str]]:
    """The pages (address, text) of a package's API: one for its root, one for each folder."""
    root = PACKAGES[package]
    for folder in [root, *sorted(path for path in root.rglob("*") if path.is_dir())]:
        modules = [path for path in sorted(folder.glob("*.py")) if path.name != "__init__.py"]
        if modules:
            parts = folder.relative_to(root).parts
            name = ".".join((package, *parts))
            words = description(folder / "__init__.py")
            blocks = [f"::: {name}.{module.stem}" for module in modules]
            uri = "/".join(("reference", package, *(parts or ("index",)))) + ".md"
            yield uri, "\n\n".join([f"# {name}", *([words] if words else []), *blocks])


def description(path: Path) -> str:
    """The docstring of a file, if there is one."""
    return ast.get_docstring(ast.parse(path.read_text())) or "" if path.exists() else ""
