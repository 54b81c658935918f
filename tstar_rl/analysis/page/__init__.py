"""The page of results, docs/results.md: its text and figures, the README's block, and the page of every run."""

from tstar_rl.analysis.page.drawing import curve_groups, draw_page
from tstar_rl.analysis.page.every_run import runs_page
from tstar_rl.analysis.page.page import replace_block, results_head, results_page

__all__ = ["curve_groups", "draw_page", "replace_block", "results_head", "results_page", "runs_page"]
