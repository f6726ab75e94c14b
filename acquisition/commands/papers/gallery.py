"""Command `gonio gallery`: the papers' figures, drawn by the models and checked, on one page."""

from __future__ import annotations

from pathlib import Path

from acquisition.commands.outcomes.new_folder import require_new_folder, write_files
from acquisition.terminal.console import out, print_lines, print_notes, print_text
from acquisition.terminal.layout import table_lines
from acquisition.terminal.progress import sign_of_life
from analysis.gallery.figure import Check, Paper
from analysis.gallery.page import gallery_html, plain_text
from analysis.gallery.papers import PAPERS

_PAGE = "index.html"


def draw_gallery(folder: Path) -> None:
    """Draw all figures into `index.html` of a new or empty folder, and print what holds.

    Raises `InputError` for a folder that holds something, before anything is drawn.
    """
    require_new_folder(folder, "gonio gallery: --out")
    with sign_of_life(f"{sum(len(paper.figures) for paper in PAPERS)} figures"):
        page, checks = gallery_html(PAPERS)
    write_files(folder, {_PAGE: page})
    rows = [_row(paper, checks[paper.key]) for paper in PAPERS]
    header = ("paper", "figures", "statements", "hold")
    print_lines([*table_lines(header, rows, out.width), ""])
    failing = [
        f"{paper.key}: {plain_text(check.said)}: {plain_text(check.found)}"
        for paper in PAPERS
        for check in checks[paper.key]
        if not check.holds
    ]
    if failing:
        print_text("Statements that do not hold, with the reason on the page:")
        print_notes(failing)
    print_lines(["", str(folder / _PAGE)])


def _row(paper: Paper, checks: list[Check]) -> tuple[str, ...]:
    held = sum(check.holds for check in checks)
    return paper.key, str(len(paper.figures)), str(len(checks)), str(held)
