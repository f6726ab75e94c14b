"""Style of the report: colours and markers of the charts, number format, style sheet.

Suitable for screens and for black-and-white printers.
"""

from __future__ import annotations

import html
import io
import math
import re
from collections.abc import Callable, Iterable
from decimal import Decimal
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

if TYPE_CHECKING:
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

# The page may load nothing and run nothing, also if a text of a run should ever get past `escaped`.
_POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; "
    "form-action 'none'"
)

_WIDTH_IN = 9.6

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


class Drawing(NamedTuple):
    """Chart that is not drawn yet: its height in inches, and what draws it into a figure."""

    height_in: float
    draw: Callable[[Figure], None]


def drawn_in(kind: type[F], drawing: Drawing) -> F:
    """Draw into a new figure of the given class of Matplotlib's figures."""
    import matplotlib as mpl

    with mpl.rc_context(_SETTINGS):
        figure = kind(figsize=(_WIDTH_IN, drawing.height_in))
        drawing.draw(figure)
    return figure


def svg_of(height_in: float, draw: Callable[[Figure], None], name: str) -> str:
    """Draw a figure as an SVG element whose ids begin with `name`; reproducible byte by byte.

    Matplotlib's settings are changed only while drawing.
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    with mpl.rc_context(_SETTINGS):
        figure = Figure(figsize=(_WIDTH_IN, height_in))
        FigureCanvasSVG(figure)
        draw(figure)
        text = io.StringIO()
        nothing = dict.fromkeys(("Creator", "Date", "Format", "Type"))
        figure.savefig(text, format="svg", transparent=True, metadata=nothing)
    return _embedded(text.getvalue(), name)


def _embedded(svg: str, name: str) -> str:
    """The SVG for use inside a page: without header and fixed size, with unique ids."""
    svg = svg[svg.index("<svg") :].replace("xlink:href=", "href=")
    head, end, body = svg.partition(">")
    head = re.sub(r' (width|height|xmlns:xlink)="[^"]*"', "", head)
    return head + end + re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{name}-", body)


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
    visible = "".join(c if c.isprintable() or c in "\n\t\u00a0" else "\ufffd" for c in raw)
    return html.escape(visible)


def html_page(title: str, css: str, body: Iterable[str]) -> str:
    """Page of the parts of its body that are not empty; all in HTML."""
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">\n'
        f"<title>{title}</title>\n<style>{css}</style>\n</head>\n<body>\n"
        + "\n".join(part for part in body if part)
        + "\n</body>\n</html>\n"
    )


def figure_html(drawings: list[str], label: str, caption: str) -> str:
    """Figure of drawings in SVG, labelled for readers of a screen, and its caption in HTML."""
    named = f'<svg role="img" aria-label="{escaped(label)}" '
    drawn = "".join(svg.replace("<svg ", named, 1) for svg in drawings)
    return (
        f'<figure>\n<div class="chart">{drawn}</div><figcaption>{caption}</figcaption>\n</figure>'
    )


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


CSS = """
:root { --ink: #1d1d1f; --soft: #5c5f66; --rule: #d4d6da; --wash: #f5f6f7; }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 1000px; padding: 28px 24px 48px; color: var(--ink);
  background: #fff; font: 16px/1.45 system-ui, "Segoe UI", "Helvetica Neue", Arial, "DejaVu Sans",
  sans-serif; }
h1 { font-size: 28px; line-height: 1.2; margin: 0 0 4px; }
h2 { font-size: 20px; margin: 36px 0 8px; padding-top: 10px; border-top: 1px solid var(--rule); }
h3 { font-size: 16px; margin: 18px 0 6px; }
p { margin: 6px 0; }
.sample { font-size: 18px; margin: 0; }
.text, .soft { color: var(--soft); }
.text { white-space: pre-line; }
.verdict { margin: 18px 0; padding: 14px 20px 16px; border: 2px solid #6b7280;
  border-left-width: 12px; background: var(--wash); border-radius: 4px; }
.verdict.adequate { border-color: #00734f; background: #eef8f4; }
.verdict.warning { border-color: #c05a00; background: #fdf4ea; }
.verdict .state { font-size: 13px; font-weight: 700; letter-spacing: .06em;
  text-transform: uppercase; }
.verdict .headline { font-size: 21px; font-weight: 600; line-height: 1.3; margin: 2px 0 6px; }
.values { display: flex; flex-wrap: wrap; gap: 10px 36px; margin: 12px 0 4px; }
.values div { line-height: 1.25; }
.values dt { color: var(--soft); font-size: 14px; }
.values dd { margin: 0; font-size: 20px; font-weight: 600; font-variant-numeric: tabular-nums; }
dl.values { margin-bottom: 0; }
.attention { margin: 12px 0; padding: 8px 16px; border-left: 4px solid #c05a00; }
.attention ul { margin: 0; padding-left: 20px; }
figure { margin: 10px 0 18px; }
figure > svg, .chart > svg { display: block; width: 100%; height: auto; }
figure > svg text, .chart > svg text { font-family: system-ui, "Segoe UI", "Helvetica Neue", Arial,
  "DejaVu Sans", sans-serif !important; }
figcaption { color: var(--soft); font-size: 14px; margin-top: 4px; }
figcaption b { color: var(--ink); }
.wide { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-size: 15px; }
th, td { text-align: left; vertical-align: top; padding: 6px 14px 6px 8px;
  border-bottom: 1px solid var(--rule); }
th { font-size: 13px; color: var(--soft); font-weight: 600; border-bottom: 2px solid var(--soft); }
td.number, th.number { text-align: right; white-space: nowrap;
  font-variant-numeric: tabular-nums; }
tr.chosen td { background: #eef8f4; border-top: 2px solid #00734f;
  border-bottom: 2px solid #00734f; }
tr.chosen td:first-child { font-weight: 700; border-left: 8px solid #00734f; }
.parameter { display: block; white-space: nowrap; font-variant-numeric: tabular-nums; }
.name { color: var(--soft); }
.tag { display: inline-block; font-size: 12px; font-weight: 700; color: #00734f; }
td svg.share { display: block; width: 220px; height: 14px; }
.pictures { display: grid; grid-template-columns: repeat(auto-fill, minmax(270px, 1fr));
  gap: 16px; }
.pictures figure { margin: 0; break-inside: avoid; }
.pictures svg { border: 1px solid var(--rule); background: #000; }
.pictures image { image-rendering: pixelated; }
.facts { display: grid; grid-template-columns: 1fr 1fr; gap: 0 40px; }
.facts table { font-size: 14px; }
body { overflow-wrap: break-word; }
.facts td { overflow-wrap: anywhere; }
.facts td:first-child { color: var(--soft); width: 40%; }
@media (max-width: 700px) {
  body { padding: 16px 14px 32px; }
  .verdict { padding: 12px 14px; }
  .verdict .headline { font-size: 18px; }
  .chart { overflow-x: auto; }
  .chart > svg { width: 700px; }
  .chart + figcaption::before { content: "Swipe the chart sideways. "; }
  .facts { grid-template-columns: 1fr; }
  .wide th, .wide td { padding-right: 8px; }
  td svg.share { display: none; }
  .candidates thead { display: none; }
  .candidates tr { display: block; padding: 6px 0; border-bottom: 1px solid var(--rule); }
  .candidates td { display: block; border: 0; padding: 2px 8px; }
  .candidates td.number { display: inline-block; text-align: left; padding-right: 18px; }
  .candidates td.number::before { color: var(--soft); font-size: 13px; content: "rms "; }
  .candidates td:nth-child(4)::before { content: "χ²/dof "; }
  .candidates td:nth-child(5)::before { content: "ΔBIC "; }
  .candidates .parameter { white-space: normal; }
  .candidates tr.chosen { background: #eef8f4; border-left: 8px solid #00734f; }
  .candidates tr.chosen td, .candidates tr.chosen td:first-child { border: 0; }
}
@media print {
  @page { margin: 14mm; }
  body { max-width: none; padding: 0; font-size: 11pt; }
  h2, h3 { break-after: avoid; }
  .verdict, figure, tr, .attention { break-inside: avoid; }
  .verdict, .verdict.adequate, .verdict.warning, tr.chosen td { background: #fff;
    border-color: #000; }
  .wide { overflow: visible; }
  .tag { color: #000; }
  .pictures { grid-template-columns: repeat(3, 1fr); }
  figcaption, .soft, .text { color: #333; }
}
"""
