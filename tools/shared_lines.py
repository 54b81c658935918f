"""How many lines any two recipes share from `def main` on: the bookkeeping that was not taken out of them.

python tools/shared_lines.py             # all systems, the paper's and others; or name some: ... tstar evaluate

Blank lines, comments, docstrings and indentation do not count. A line that stands twice in both counts twice.
"""

import argparse
import ast
import io
import itertools
import tokenize
from collections import Counter
from pathlib import Path

from tstar_rl.config.recipe_kinds import FINE_TUNING, ONE_POLICY

RECIPES = Path(__file__).resolve().parents[1] / "recipes"
SYSTEMS = (*ONE_POLICY, *FINE_TUNING)


def code_lines(source: str) -> list[str]:
    """The lines of a recipe that count, stripped, from `def main` to its end."""
    tree = ast.parse(source)
    starts = [node.lineno for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == "main"]
    if not starts:
        raise ValueError("no function is called main")
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef)
    ignored: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, documented) and ast.get_docstring(node) is not None:
            ignored.update(range(node.body[0].lineno, (node.body[0].end_lineno or 0) + 1))
    skipped = (tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT)
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    filled = {
        line
        for token in tokens
        if token.type not in skipped and token.string.strip()
        for line in range(token.start[0], token.end[0] + 1)
    }
    lines = source.splitlines()
    kept = sorted(line for line in filled - ignored if line >= starts[0])
    return [lines[line - 1].split("  # ")[0].strip() for line in kept]


def shared_lines(one: list[str], other: list[str]) -> int:
    """How many lines two recipes share."""
    return (Counter(one) & Counter(other)).total()


def table(systems: tuple[str, ...] = SYSTEMS) -> dict[tuple[str, str], int]:
    """Shared lines of every two recipes; of a recipe with itself, all its lines."""
    lines = {name: code_lines((RECIPES / f"{name}.py").read_text()) for name in systems}
    pairs = itertools.combinations_with_replacement(systems, 2)
    return {(one, other): shared_lines(lines[one], lines[other]) for one, other in pairs}


def main() -> None:
    """Prints the table, each recipe's own number of lines on its diagonal."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recipes", nargs="*", default=SYSTEMS, help="file names in recipes/, without .py")
    systems = tuple(parser.parse_args().recipes)
    shared, width = table(systems), max(map(len, systems)) + 2
    print(" " * width + "".join(f"{name:>{width}}" for name in systems))
    for row, name in enumerate(systems):
        cells = [str(shared[other, name]) for other in systems[: row + 1]]
        print(f"{name:<{width}}" + "".join(f"{cell:>{width}}" for cell in cells))
    different = {pair: number for pair, number in shared.items() if pair[0] != pair[1]}
    if different:
        (one, other), most = max(different.items(), key=lambda item: item[1])
        print(f"at most {most} shared: {one} and {other}; the diagonal is each recipe's own number of lines")


if __name__ == "__main__":
    main()
