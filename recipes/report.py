"""Writes docs/results.md, its figures, docs/every_run.md, and the README's block, from results/published/ alone.

    python recipes/report.py                    # figures=false: the text alone

results/published/contents.yaml says which experiments are shown. The paper's figures are in docs/paper_results.yaml,
what was found in docs/results_notes.md. To publish results of yours, copy their folder to results/published/<name>/ and
name it in contents.yaml.
"""

from pathlib import Path

import yaml
from omegaconf import DictConfig

from tstar_rl.analysis.page import draw_page, replace_block, results_head, results_page, runs_page
from tstar_rl.config.load import recipe
from tstar_rl.runs.files import replacing


@recipe("report", docs_dir=str, readme=str, paper=str, notes=str, figures=bool)
def main(config: DictConfig) -> None:
    """Writes and says where."""
    root, docs, readme = Path(config.results_dir), Path(config.docs_dir), Path(config.readme)
    paper, notes = yaml.safe_load(Path(config.paper).read_text()), Path(config.notes).read_text()
    pages = {
        docs / "results.md": results_page(root, paper, notes),
        docs / "every_run.md": runs_page(root, paper),
    }
    docs.mkdir(parents=True, exist_ok=True)
    for page, text in pages.items():
        _write(page, text)
    _write(readme, replace_block(readme.read_text(), results_head(root, paper, notes)))
    print(*pages, readme)
    if config.figures:
        print(*draw_page(root, paper, docs / "figures"), sep="\n")


def _write(page: Path, text: str) -> None:
    with replacing(page) as partial:
        partial.write_text(text)


if __name__ == "__main__":
    main()
