"""Notebooks run from top to bottom: on made-up tables, on none, and on those that are committed."""

import ast
import re
from pathlib import Path

import nbformat
import pandas as pd
import pytest
from jupyter_client.manager import KernelManager
from nbclient import NotebookClient

from tstar_rl.analysis import variants

ROOT = Path(__file__).resolve().parents[2]
FIRST_STEPS = ROOT / "notebooks" / "first_steps.ipynb"
NOTEBOOKS = sorted(set((ROOT / "notebooks").glob("*.ipynb")) - {FIRST_STEPS})
"""Those that read tables."""
each = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
of_ablations = pytest.mark.parametrize("name", variants.names())
SLOW = variants.names()[:-1]
"""Notebooks of ablations are alike: the last stands for them."""
of_ablations_one_fast = pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name in SLOW)) for name in variants.names()]
)
each_one_ablation_fast = pytest.mark.parametrize(
    "path",
    [pytest.param(path, id=path.stem, marks=[pytest.mark.slow] * (path.stem in SLOW)) for path in NOTEBOOKS],
)


@pytest.fixture(scope="module")
def kernel():
    """One kernel for all: most of a short notebook's time is its imports."""
    manager = KernelManager(kernel_name="python3")
    yield manager
    manager.shutdown_kernel(now=True)


def run(path: Path, kernel: KernelManager, folder: Path) -> tuple[str, int]:
    """Runs a notebook as if it lay in `folder`; returns all text that it shows, and the number of pictures."""
    notebook = nbformat.read(path, as_version=4)
    begin = nbformat.v4.new_code_cell(f"%reset -f\n%cd -q {folder}")
    notebook.cells.insert(0, begin)
    NotebookClient(notebook, km=kernel, timeout=120, resources={"metadata": {"path": str(folder)}}).execute()
    texts, pictures = [], 0
    for cell in notebook.cells:
        for output in cell.get("outputs", ()):
            assert output.output_type != "error"
            texts.append(output.get("text", "") + output.get("data", {}).get("text/plain", ""))
            pictures += "image/png" in output.get("data", {})
    return "\n".join(texts), pictures


def links_of(variant) -> int:
    """Skills of a variant's chain: a shorter one logs less."""
    said = [override for override in variant.overrides if override.startswith("chain.links=")]
    return int(said[0].partition("=")[2]) if said else 4


def make_tables(results: Path, name: str) -> None:
    """Tables of two seeds, in which every variant does a little better than the one before it."""
    for number, variant in enumerate(variants.read(name).variants):
        for seed in (0, 1):
            folder = results / "table_lack" / variant.place / f"seed{seed}"
            folder.mkdir(parents=True)
            share = 0.4 + 0.05 * number + 0.01 * seed
            row = {"checkpoint": "last", "mode": "deterministic", "episodes": 200, "progress": share}
            row |= {"success": share, **{f"subtask_{k}": share for k in range(4)}, "seed": seed}
            pd.DataFrame([row]).to_csv(folder / "evaluation.csv", index=False)
            logged = {"success_rate": share, "tsr_on_success": 0.5}
            logged |= {"d_omega_initiation_score": 0.6, "d_omega_termination_score": 0.4}
            rows = [{"env_steps": 10 * (k + 1), "skill": k, **logged} for k in range(links_of(variant))]
            if variant.trains:
                pd.DataFrame(rows).to_csv(folder / "metrics.csv", index=False)


def test_every_ablation_has_a_notebook():
    assert {path.stem for path in NOTEBOOKS} >= set(variants.names())


def code_without_outputs(path: Path) -> list:
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert all(not cell.outputs and cell.execution_count is None for cell in cells), "strip its outputs"
    return cells


@each
def test_it_is_kept_without_outputs_and_reads_tables_alone(path):
    cells = code_without_outputs(path)
    source = "\n".join(line for cell in cells for line in cell.source.splitlines() if line[:1] != "%")
    imported = {node.module for node in ast.walk(ast.parse(source)) if isinstance(node, ast.ImportFrom)}
    assert imported <= {"tstar_rl.analysis"}


def assert_all_is_shown(name: str, text: str, pictures: int) -> None:
    assert all(variant.name in text for variant in variants.read(name).variants)
    assert pictures >= 2 and "against" in text and "No table yet" not in text and "No finding yet" not in text


@of_ablations_one_fast
def test_it_shows_tables_and_says_what_they_show(name, kernel, tmp_path):
    (tmp_path / "notebooks").mkdir()
    make_tables(tmp_path / "results" / "published" / "ablations", name)
    shown = run(ROOT / "notebooks" / f"{name}.ipynb", kernel, tmp_path / "notebooks")
    assert_all_is_shown(name, *shown)


@pytest.mark.slow
@of_ablations
def test_without_tables_it_says_what_makes_them(name, kernel, tmp_path):
    (tmp_path / "notebooks").mkdir()
    text, _ = run(ROOT / "notebooks" / f"{name}.ipynb", kernel, tmp_path / "notebooks")
    assert f"python recipes/ablate.py ablation={name} seed=0" in text and "No finding yet" in text


@each_one_ablation_fast
def test_it_runs_on_the_committed_tables(path, kernel):
    text, pictures = run(path, kernel, ROOT / "notebooks")
    if path.stem in variants.names():
        assert_all_is_shown(path.stem, text, pictures)
    else:
        assert "verdict" in text and pictures >= 2
        assert re.search(r" (higher|lower|no clear difference) *$", text, re.MULTILINE)


def test_first_steps_are_kept_without_outputs():
    assert code_without_outputs(FIRST_STEPS)


@pytest.mark.slow
def test_first_steps_show_a_chain_that_fails_and_the_same_mended(kernel):
    text, pictures = run(FIRST_STEPS, kernel, ROOT / "notebooks")
    shares = dict(re.findall(r"^narrow_(\w+): ([\d.]+) of the subtasks", text, re.MULTILINE))
    assert float(shares["failing"]) < 0.8 and float(shares["mended"]) > 0.9 and pictures >= 2
