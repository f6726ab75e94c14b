"""Shortened SVG: the same elements, texts and places, in fewer letters."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import numpy as np
import pytest

from analysis.report.compact_svg import compact_svg
from analysis.report.style import Drawing, svg_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_PLACES = ("d", "x", "y", "transform")


def random_chart(seed: int) -> str:
    """Chart of lines, markers of several series and texts with spaces, of random values."""
    rng = np.random.default_rng(seed)

    def draw(figure: Figure) -> None:
        ax = figure.add_subplot()
        for marker in "os^x":
            size = rng.uniform(1e-3, 1e3)
            ax.plot(rng.normal(0, size, 12), rng.normal(0, size, 12), marker=marker)
        ax.scatter(*rng.normal(size=(2, 9)), c=rng.uniform(size=9))
        ax.set_title("  two  spaces < & > ", rotation=float(rng.uniform(-90, 90)))

    svg = svg_file(Drawing(3.0, draw))
    return svg[svg.index("<svg") :].replace("xlink:href=", "href=")


@pytest.mark.parametrize("seed", range(6))
def test_the_picture_is_the_same_in_fewer_letters(seed: int) -> None:
    long = random_chart(seed)
    short = compact_svg(long)
    assert len(short) < 0.75 * len(long)
    for one, other in zip(*(ElementTree.fromstring(s).iter() for s in (long, short)), strict=True):
        assert one.tag == other.tag
        assert (one.text or "").strip() == (other.text or "").strip()
        for name in _PLACES:
            before, after = (numbers(element.get(name, "")) for element in (one, other))
            np.testing.assert_allclose(after, before, rtol=0, atol=0.00501)
            commands = [re.findall(r"[A-Za-z]+", e.get(name, "")) for e in (one, other)]
            assert "".join(commands[0]) == "".join(commands[1])


@pytest.mark.parametrize("seed", range(6))
def test_every_element_keeps_its_style_and_what_it_refers_to(seed: int) -> None:
    long, short = random_chart(seed), compact_svg(random_chart(seed))
    assert styles(long) == styles(short)
    ids = re.findall(r'\bid="([^"]+)"', short)
    assert len(ids) == len(set(ids))
    referred = [set(re.findall(r'(?:href="|url\()#([^")]+)', s)) for s in (long, short)]
    assert referred[1] <= set(ids)
    assert len(referred[0]) == len(referred[1])


def numbers(text: str) -> list[float]:
    return [float(n) for n in re.findall(r"-?\d+(?:\.\d+)?(?:e-?\d+)?", text)]


def styles(svg: str) -> list[str]:
    """Style of each marker, path and text: its own, or that of the group around it."""
    found = []

    def walk(element: ElementTree.Element, around: str) -> None:
        own = element.get("style", around).replace(" ", "")
        if not element.tag.endswith("}g"):
            found.append(own)
        for child in element:
            walk(child, own)

    walk(ElementTree.fromstring(svg), "")
    return found
