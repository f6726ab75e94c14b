"""Command `gonio gallery`: one page in a new folder, and what does not hold in the terminal."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from acquisition.commands.papers import gallery
from analysis.gallery.papers import PAPERS
from tests.support.command import gonio_here as gonio


@pytest.fixture
def _few_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures 11 and 12 of 1991: two charts, each with a statement that does not hold."""
    one = next(paper for paper in PAPERS if paper.key == "1991")
    monkeypatch.setattr(gallery, "PAPERS", (replace(one, figures=one.figures[2:4]),))


@pytest.mark.usefixtures("_few_figures")
def test_the_page_is_written_and_told_of(tmp_path: Path) -> None:
    done = gonio("gallery", "--out", tmp_path / "new")
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "new" / "index.html").read_text(encoding="utf-8")
    assert "1991, Figure 11." in page
    assert "1991, Figure 12." in page
    assert str(tmp_path / "new" / "index.html") in done.stdout.replace("\n", "")
    assert "1991: for dielectrics" in " ".join(done.stdout.split())


@pytest.mark.parametrize("taken", ["file", "folder", "parent"])
def test_nothing_is_replaced(tmp_path: Path, taken: str) -> None:
    target = tmp_path / "taken"
    if taken == "file":
        target.write_text("kept")
    elif taken == "folder":
        target.mkdir()
        (target / "index.html").write_text("kept")
    else:
        target = target / "below"
    before = sorted(tmp_path.rglob("*"))
    done = gonio("gallery", "--out", target)
    assert done.returncode == 2
    assert str(target) in done.stderr
    assert sorted(tmp_path.rglob("*")) == before
