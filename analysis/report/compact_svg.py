"""Shorter form of Matplotlib's SVG for a page: the same picture in about half as many letters."""

from __future__ import annotations

import re

_NUMBER = re.compile(r"-?\d+\.\d+")
_ID = re.compile(r'(\bid="|href="#|url\(#)([^")]+)')
_PATH = re.compile(r' d="([^"]*)"')
_PLACE = re.compile(r' (x|y|transform)="([^"]*)"')
_STYLE = re.compile(r' style="([^"]*)"')
# Markers of one series, to each of which Matplotlib gives the same style.
_MARKERS = re.compile(r'(<g[^>]*)>((?:<use [^>]* style="[^"]*"/>)+)</g>')


def compact_svg(svg: str) -> str:
    """Shorten an SVG: places to 0.01 points, one style for the markers of a series, no spare ids.

    Nothing refers to the ids of groups, and spaces between elements show nothing.
    """
    svg = re.sub(r'<g id="[^"]*"', "<g", svg)
    svg = re.sub(r">\s+<", "><", svg)
    svg = _with_short_ids(svg)
    svg = _PATH.sub(lambda found: f' d="{_path(found[1])}"', svg)
    svg = _PLACE.sub(lambda found: f' {found[1]}="{_rounded(found[2])}"', svg)
    svg = _STYLE.sub(lambda found: f' style="{_style(found[1])}"', svg)
    return _MARKERS.sub(_in_one_style, svg)


def _with_short_ids(svg: str) -> str:
    """Number the ids, and what refers to them, in the order in which they come."""
    numbers: dict[str, str] = {}
    return _ID.sub(lambda m: f"{m[1]}i{numbers.setdefault(m[2], str(len(numbers)))}", svg)


def _path(commands: str) -> str:
    return re.sub(r" ?([A-Za-z]) ?", r"\1", _rounded(" ".join(commands.split())))


def _style(properties: str) -> str:
    return re.sub(r"([:;]) ", r"\1", properties)


def _rounded(numbers: str) -> str:
    return _NUMBER.sub(lambda found: _decimal(float(found[0])), numbers)


def _decimal(number: float) -> str:
    text = f"{number:.2f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _in_one_style(group: re.Match[str]) -> str:
    styles = set(_STYLE.findall(group[2]))
    if len(styles) > 1 or " style=" in group[1]:
        return group[0]
    return f'{group[1]} style="{styles.pop()}">{_STYLE.sub("", group[2])}</g>'
