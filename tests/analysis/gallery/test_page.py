"""The page of the gallery: one file, no script, every figure with its checks."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser
from xml.etree import ElementTree

import numpy as np
import pytest

from analysis.gallery.figure import Check, Paper, PaperFigure
from analysis.gallery.page import gallery_html, plain_text
from analysis.gallery.panels import Axis, Line, chart, polar
from analysis.gallery.papers import PAPERS


def _figure() -> PaperFigure:
    x = np.linspace(-60.0, 60.0, 5)
    lines = (Line(x, np.cos(np.radians(x)), "cosine", 0), Line(x, x / 90, "", 1, thin=True))
    return PaperFigure(
        number="7",
        title="A figure",
        caption="By equation (1).",
        panels=(
            chart("(a) θ<sub>r</sub> &lt; 90°", lines, Axis("θ (°)"), Axis("value")),
            polar("(b)", lines[:1], ((-40.0, "source"),)),
        ),
        checks=(Check("it rises", "0.5", True), Check("it falls", "0.4", False, "It does not.")),
    )


PAPER = Paper(key="2000", citation="A paper", figures=(_figure,), left_out="nothing")


class _Tags(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []

    def handle_starttag(self, tag: str, _: object) -> None:
        if tag not in ("meta", "br", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_the_page_loads_nothing_and_is_well_formed() -> None:
    page, checks = gallery_html([PAPER])
    assert not re.findall(r'(?:href|src)="(?!#|data:)', page)
    assert "<script" not in page
    tags = _Tags()
    tags.feed(page)
    assert not tags.open
    for svg in re.findall(r"<svg .*?</svg>", page, flags=re.DOTALL):
        ElementTree.fromstring(svg)
    ids = re.findall(r'\bid="([^"]+)"', page)
    assert len(ids) == len(set(ids))
    assert [check.holds for check in checks["2000"]] == [True, False]


def test_a_statement_that_does_not_hold_says_why() -> None:
    page, _ = gallery_html([PAPER])
    text = plain_text(page)
    assert "1 of 2 statements hold" in text
    assert "✗It falls: 0.4. It does not." in text
    assert "✓It rises: 0.5." in text


def test_the_same_models_give_the_same_page() -> None:
    assert gallery_html([PAPER]) == gallery_html([PAPER])


def test_words_for_a_reader_of_a_screen_have_no_marks() -> None:
    page, _ = gallery_html([PAPER])
    assert 'aria-label="2000, Figure 7: (a) θr &lt; 90°"' in page


@pytest.mark.slow
def test_the_gallery_is_drawn(slow: bool) -> None:
    """All figures; in the bounded form one of each paper."""
    chosen = [p if slow else replace(p, figures=p.figures[1:2]) for p in PAPERS]
    page, _ = gallery_html(chosen)
    panels = sum(len(make().panels) for paper in chosen for make in paper.figures)
    assert page.count("<svg ") == panels
    tags = _Tags()
    tags.feed(page)
    assert not tags.open
