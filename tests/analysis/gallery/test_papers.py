"""Every figure of the papers that needs no photograph is there, and holds what the paper states."""

from __future__ import annotations

from functools import cache

import pytest

from analysis.gallery.figure import Paper, PaperFigure
from analysis.gallery.papers import PAPERS

# Figures without a photograph, a measurement alone, or a sketch that only defines symbols.
FIGURES: dict[str, list[object]] = {
    "1991": [*range(9, 18)],
    "1994": [5, 6, 8, 9, *range(12, 16)],
    "1995": [*range(5, 15), *range(16, 23), *range(24, 28)],
    "1998": [1, *range(3, 17), "§4"],
}
# Statements of the papers that the models contradict, by the beginning of their words.
CONTRADICTED = {
    ("1991", "11"): ["for dielectrics"],
    ("1991", "12"): ["and faster than"],
    ("1995", "13"): ["also interreflection (34)"],
    ("1995", "14"): ["it is reasonably accurate"],
    ("1995", "25"): ["the map becomes linear only"],
    ("1998", "13"): ["the map becomes linear only"],
    ("1998", "§4"): ["a property, not stated"],
    ("1998", "14"): ["high roughness makes the three faces"],
}


@cache
def _figures(paper: Paper) -> list[PaperFigure]:
    return [make() for make in paper.figures]


@pytest.mark.parametrize("paper", PAPERS, ids=lambda paper: paper.key)
def test_every_figure_that_needs_no_photograph_is_there(paper: Paper) -> None:
    assert [f.number for f in _figures(paper)] == [str(n) for n in FIGURES[paper.key]]


@pytest.mark.parametrize("paper", PAPERS, ids=lambda paper: paper.key)
def test_the_models_give_what_the_paper_states(paper: Paper) -> None:
    """The few exceptions are named here and, with a reason, on the page."""
    failing = {
        (paper.key, figure.number): [c.said for c in figure.checks if not c.holds]
        for figure in _figures(paper)
    }
    for figure, said in failing.items():
        known = CONTRADICTED.get(figure, [])
        assert len(said) == len(known), (figure, said)
        assert all(words.startswith(begin) for words, begin in zip(said, known, strict=True))


@pytest.mark.parametrize("paper", PAPERS, ids=lambda paper: paper.key)
def test_every_figure_is_a_test_and_says_of_what(paper: Paper) -> None:
    for figure in _figures(paper):
        assert figure.panels, figure.number
        assert figure.checks, figure.number
        assert all(check.holds or check.remark for check in figure.checks), figure.number
        assert "(" in figure.caption, f"{figure.number}: no equation is named"
