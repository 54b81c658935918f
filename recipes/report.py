"""Writes docs/results.md, its figures, and the block of it that the README shows, from the tables below results/.

    python recipes/report.py                    # figures=false: the text alone

The paper's figures are read from docs/paper_results.yaml, what did not reproduce and why from docs/results_notes.md.
"""

import shutil
from pathlib import Path

from omegaconf import DictConfig

from tstar_rl.analysis.plotting import read_evaluations, read_metrics
from tstar_rl.analysis.report import curve_groups, other_roots, replace_block, results_head, results_page
from tstar_rl.analysis.result_plots import seed_curves
from tstar_rl.config.load import recipe

COLUMNS = {
    "skills": {"success_rate": "seed", "episode_length": "seed"},
    "chains": {"success_rate": "skill", "trial_progress": "seed"},
    "single_policies": {"phase": "seed", "completed": "seed"},
}


@recipe(
    "report", docs_dir=str, readme=str, paper=str, notes=str, readme_folders=tuple[str, ...], figures=bool
)
def main(config: DictConfig) -> None:
    """Writes and says where."""
    if read_evaluations(config.results_dir).empty:
        raise SystemExit(f"no evaluation.csv below {config.results_dir}: evaluate something first")
    page, readme = Path(config.docs_dir) / "results.md", Path(config.readme)
    page.parent.mkdir(parents=True, exist_ok=True)
    page.write_text(results_page(config.results_dir, config.paper, config.notes))
    head = results_head(config.results_dir, config.paper, config.readme_folders)
    readme.write_text(replace_block(readme.read_text(), head))
    print(page, readme)
    if config.figures:
        draw(Path(config.results_dir), page.parent / "figures")
        for folder in other_roots(config.results_dir):
            draw(folder, page.parent / "figures", f"{folder.name}_")


def draw(results: Path, figures: Path, prefix: str = "") -> None:
    """Draws the curves of every task, and copies what other recipes drew of it."""
    metrics = read_metrics(results)
    if metrics.empty:
        return
    for task in sorted(metrics["task"].unique()):
        for name, rows in curve_groups(metrics, task).items():
            where = rows["recipe"] + (" " + rows["subtask"].astype(str) if name == "skills" else "")
            path = figures / f"{prefix}{task}_{name}.png"
            print(seed_curves(rows.assign(panel=where), path, COLUMNS[name], "panel"))
        for name in ("terminal_states", "hand_over"):
            drawn = results / task / f"{name}.png"
            if drawn.is_file():
                print(shutil.copyfile(drawn, figures / f"{prefix}{task}_{name}.png"))


if __name__ == "__main__":
    main()
