"""Style of the report: colours and markers of the charts, number format, parts of a page.

Suitable for screens and for black-and-white printers; the style sheet is assets/report.css.
"""

from __future__ import annotations

import base64
import hashlib
import html
import io
import math
import re
from collections.abc import Callable, Iterable, Sequence
from decimal import Decimal
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from analysis.report.compact_svg import compact_svg
from instrument.geometry import FloatArray, IntArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

F = TypeVar("F", bound="Figure")
Dashes = str | tuple[float, tuple[float, ...]]

# Palette of Okabe and Ito, distinguishable by colour-blind readers, without yellow.
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#AA4499", "#000000", "#B8860B", "#56B4E9")
_MARKERS = ("o", "s", "^", "D", "v", "P", "X", "p")
_DASHES: tuple[Dashes, ...] = (
    "-",
    (0, (6, 2)),
    (0, (6, 2, 1.5, 2)),
    (0, (1.5, 1.5)),
    (0, (9, 2, 1.5, 2, 1.5, 2)),
)
INK, GREY, GRID, BAND = "#222222", "#666666", "#DDDDDD", "#ECECEC"

# The page may load nothing and run nothing but its own script, also if a text of a run should ever
# get past `escaped`.
_POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; "
    "form-action 'none'"
)
_ASSETS = Path(__file__).parent / "assets"
CSS = (_ASSETS / "report.css").read_text(encoding="utf-8")
HOVER = (_ASSETS / "hover.js").read_text(encoding="utf-8")

WIDTH_IN = 9.6
NARROW_IN = 4.3
"""Widths of a chart on a screen or on paper, and on a phone."""

_FLOAT_DIGITS = 15  # significant decimal digits that every float keeps
_PLAIN = (-6, 6)  # powers of ten of the first digit that are written as plain decimals

_SETTINGS: dict[Any, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "gonio",
    "font.family": "DejaVu Sans",
    "font.size": 10.0,
    "axes.titlesize": 10.5,
    "axes.titley": 1.0,  # fixed, which saves measuring texts to place the title
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "axes.labelsize": 10.5,
    "axes.edgecolor": GREY,
    "axes.labelcolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.formatter.useoffset": False,
    "axes.unicode_minus": True,
    "text.parse_math": False,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "lines.linewidth": 1.5,
    "lines.markersize": 4.5,
}


def style_of(incidence: int) -> tuple[str, str, Dashes]:
    """Colour, marker and line style of the incidence with this number."""
    return (
        _COLOURS[incidence % len(_COLOURS)],
        _MARKERS[incidence % len(_MARKERS)],
        _DASHES[incidence % len(_DASHES)],
    )


class Marks(NamedTuple):
    """Points of a chart that show their values: places (P,) on its axes, and numbers (P,)."""

    axes: Axes
    x: FloatArray
    y: FloatArray
    numbers: IntArray


Draw = Callable[["Figure"], Sequence[Marks] | None]


class Drawing(NamedTuple):
    """Chart that is not drawn yet: its height, what draws it into a figure, and its width.

    Both in inches.
    """

    height_in: float
    draw: Draw
    width_in: float = WIDTH_IN


def drawn_in(kind: type[F], drawing: Drawing) -> F:
    """Draw into a new figure of the given class of Matplotlib's figures."""
    import matplotlib as mpl

    with mpl.rc_context(_SETTINGS):
        figure = kind(figsize=(drawing.width_in, drawing.height_in))
        drawing.draw(figure)
    return figure


def svg_of(height_in: float, draw: Draw, name: str) -> str:
    """Draw a figure as an SVG element whose ids begin with `name`; reproducible byte by byte."""
    return embedded_svg(Drawing(height_in, draw), name)


def embedded_svg(drawing: Drawing, name: str) -> str:
    """Return a chart as an SVG element for a page: without fixed size, with unique ids."""
    svg, marks = _drawn(drawing, transparent=True)
    svg = compact_svg(svg[svg.index("<svg") :].replace("xlink:href=", "href="))
    head, end, body = svg.partition(">")
    head = re.sub(r' (width|height|xmlns:xlink)="[^"]*"', "", head)
    body = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{name}-", body)
    return head + end + body.replace("</svg>", f"{marks}</svg>")


def svg_file(drawing: Drawing) -> str:
    """Return a chart as the text of an SVG file, on white."""
    return _drawn(drawing, transparent=False)[0]


def _drawn(drawing: Drawing, *, transparent: bool) -> tuple[str, str]:
    """Draw a chart; return it and its marks as SVG. Matplotlib is set only meanwhile."""
    import matplotlib as mpl
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    with mpl.rc_context(_SETTINGS):
        figure = Figure(figsize=(drawing.width_in, drawing.height_in))
        FigureCanvasSVG(figure)
        marks = drawing.draw(figure) or ()
        text = io.StringIO()
        nothing = dict.fromkeys(("Creator", "Date", "Format", "Type"))
        figure.savefig(text, format="svg", transparent=transparent, metadata=nothing)
        return text.getvalue(), _marks_svg(marks, drawing.height_in)


def _marks_svg(marks: Sequence[Marks], height_in: float) -> str:
    """Circles at the points, in the SVG's points (72 an inch, downwards); those outside left out.

    Each has the number of its point as `data-p`.
    """
    circles = []
    for axes, x, y, numbers in marks:
        with np.errstate(all="ignore"):
            at = axes.transData.transform(np.column_stack([x, y])) * (72.0 / axes.figure.dpi)
        box = axes.get_window_extent().padded(1.0)
        low, high = (np.asarray(end) * (72.0 / axes.figure.dpi) for end in (box.min, box.max))
        inside = np.all(np.isfinite(at) & (at >= low) & (at <= high), axis=1)
        circles += [
            f'<circle cx="{left:.1f}" cy="{72.0 * height_in - up:.1f}" data-p="{number}"/>'
            for (left, up), number in zip(at[inside], numbers[inside], strict=True)
        ]
    return f'<g class="marks">{"".join(circles)}</g>' if circles else ""


def format_value(value: float, u: float | None, unit: str = "") -> str:
    """Format a value rounded to two significant digits of its uncertainty: `20.013 ± 0.021 °`.

    Without a valid uncertainty: the value alone, with four significant digits. Where u lies beyond
    the last digit that a float holds, each of the two has a power of ten of its own.
    """
    suffix = f"\u00a0{unit}" if unit else ""
    if not math.isfinite(value):
        return "—"
    if u is None or not math.isfinite(u) or u <= 0:
        return f"{_general(value, 4)}{suffix}"
    first = _exponent(u, 2)
    largest = max(_exponent(max(abs(value), u), _FLOAT_DIGITS), first)
    if largest - first >= _FLOAT_DIGITS:
        return f"{_general(value, _FLOAT_DIGITS)} ± {_general(u, 2)}{suffix}"
    plain = _PLAIN[0] <= largest <= _PLAIN[1] or (_PLAIN[0] <= first and largest <= _PLAIN[1])
    power = 0 if plain else largest
    text = " ± ".join(_rounded(number, first - 1, power) for number in (value, u))
    return f"{text}{suffix}" if plain else f"({text}){_times_ten_to(power)}{suffix}"


def interval_text(low: float, high: float) -> tuple[str, str]:
    """Format the ends of an interval, with equal decimals and two digits of half its width."""
    half = (high - low) / 2
    if not (math.isfinite(half) and half > 0):
        return _general(low, 4), _general(high, 4)
    last = _exponent(half, 2) - 1
    if not _PLAIN[0] <= last <= 0 or max(abs(low), abs(high)) >= 10.0 ** _PLAIN[1]:
        digits = max(2, _exponent(max(abs(low), abs(high)), 2) - last + 1)
        return _general(low, min(digits, 15)), _general(high, min(digits, 15))
    return _rounded(low, last, 0), _rounded(high, last, 0)


def short_number(value: float | None, digits: int) -> str:
    """Format a number with at most `digits` significant digits, without unit: 0.709, 1.79 × 10⁴."""
    return "—" if value is None or not math.isfinite(value) else _general(value, digits)


def _exponent(number: float, digits: int) -> int:
    """Power of ten of the first of `digits` significant digits, 0 for 0."""
    return int(f"{number:.{digits - 1}e}".partition("e")[2])


def _general(number: float, digits: int) -> str:
    """A number with at most `digits` significant digits: 0.015, 1.5 × 10⁻⁹."""
    mantissa, _, power = f"{number:.{digits}g}".partition("e")
    return mantissa + (_times_ten_to(int(power)) if power else "")


def _rounded(number: float, last: int, power: int) -> str:
    """A number rounded to the digit of 10^last, in units of 10^power, in decimal notation."""
    digit = Decimal(number).quantize(Decimal(1).scaleb(last))
    return f"{digit.scaleb(-power) + 0:f}"  # + 0: no minus before a zero


def _times_ten_to(power: int) -> str:
    return "\u00a0×\u00a010" + str(power).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def escaped(raw: str) -> str:
    """Return a text from outside as HTML and XML; characters that cannot be shown are replaced."""
    return html.escape(visible(raw))


def visible(raw: str) -> str:
    """Return a text from outside with characters that cannot be shown replaced."""
    return "".join(c if c.isprintable() or c in "\n\t\u00a0" else "\ufffd" for c in raw)


def html_page(title: str, css: str, body: Iterable[str], script: str = "") -> str:
    """Page of the parts of its body that are not empty; all in HTML.

    `script`: the only one that the page may run, by its hash (Content Security Policy level 3).
    """
    policy = _POLICY
    if script:
        digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii")
        policy += f"; script-src 'sha256-{digest}'"
        script = f"\n<script>{script}</script>"
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        f"<title>{title}</title>\n<style>{css}</style>\n</head>\n<body>\n"
        + "\n".join(part for part in body if part)
        + f"{script}\n</body>\n</html>\n"
    )


def figure_html(
    drawings: Sequence[str], label: str, caption: str, narrow: Sequence[str] = ()
) -> str:
    """Figure of drawings in SVG, labelled for readers of a screen, and its caption in HTML.

    `narrow`: the same, drawn for a phone.
    """
    if narrow:
        charts = _chart_html(drawings, label, " broad") + _chart_html(narrow, label, " narrow")
    else:
        charts = _chart_html(drawings, label)
    return f"<figure>\n{charts}<figcaption>{caption}</figcaption>\n</figure>"


def _chart_html(drawings: Sequence[str], label: str, width: str = "") -> str:
    named = f'<svg role="img" aria-label="{escaped(label)}" '
    drawn = "".join(svg.replace("<svg ", named, 1) for svg in drawings)
    return f'<div class="chart{width}">{drawn}</div>'


def table_html(head: Iterable[str], rows: Iterable[str], kind: str = "wide") -> str:
    """Table of a head and rows in HTML; `kind`: class of the block around it."""
    body = f"<thead>{row_html(head, cell='th')}</thead><tbody>{''.join(rows)}</tbody>"
    return f'<div class="{kind}"><table>{body}</table></div>'


def row_html(cells: Iterable[str], style: str = "", cell: str = "td") -> str:
    """Table row of cells in HTML; a cell that begins with # is a number."""
    made = (
        f'<{cell} class="number">{c[1:]}</{cell}>' if c.startswith("#") else f"<{cell}>{c}</{cell}>"
        for c in cells
    )
    return f'<tr class="{style}">{"".join(made)}</tr>' if style else f"<tr>{''.join(made)}</tr>"
