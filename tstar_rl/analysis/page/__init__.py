"""The page of results, docs/results.md: its text, its figures, and the block that the README shows."""

from tstar_rl.analysis.page.drawing import curve_groups, draw_page
from tstar_rl.analysis.page.page import replace_block, results_head, results_page

__all__ = ["curve_groups", "draw_page", "replace_block", "results_head", "results_page"]
