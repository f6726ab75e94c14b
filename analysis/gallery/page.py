"""Page of the gallery: all figures of the papers with their captions and checks, in one file."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from html import unescape

from analysis.gallery.figure import Check, Paper, PaperFigure
from analysis.report.style import CSS, embedded_svg, escaped, html_page, row_html, table_html

_LONG = 6  # panels, which with their heading fill a printed page
_TITLE = "The papers’ figures, drawn by the models"
_CSS = """
.panels { display: grid; grid-template-columns: repeat(2, minmax(0, 1fr)); gap: 14px 32px; }
.panels > div { min-width: 0; break-inside: avoid; }
.panels p { font-size: 14px; font-weight: 600; margin: 0 0 2px; }
.panels svg { display: block; width: 100%; height: auto; }
.panels svg text { font-family: system-ui, "Segoe UI", "Helvetica Neue", Arial, "DejaVu Sans",
  sans-serif !important; }
.panels figcaption { grid-column: 1 / -1; margin: 0; }
.panels.odd figcaption { grid-column: auto; align-self: start; }
figcaption ul { margin: 8px 0 0; padding: 0; list-style: none; }
figcaption li { margin: 0 0 6px; padding-left: 22px; text-indent: -22px; }
figcaption li b { display: inline-block; width: 22px; text-indent: 0; }
.holds b { color: var(--good); }
.fails b { color: var(--bad); }
.fails .remark, .holds .remark { color: var(--ink); }
h3 a { color: inherit; text-decoration: none; }
@media (max-width: 700px) {
  .panels, .panels.odd { grid-template-columns: minmax(0, 1fr); }
  .toc table { font-size: 14px; }
}
@media screen and (prefers-color-scheme: dark) {
  .panels .line > svg { filter: invert(0.93) hue-rotate(180deg); }
  .panels .picture > svg { background: #fff; }
}
@media print {
  /* A grid parts between rows only; one of few panels stays with its caption and its heading. */
  .panels { gap: 8px 20px; }
  .drawn { break-inside: avoid; }
  .drawn.long, .drawn.long .panels { break-inside: auto; }
  .panels figcaption { break-inside: auto; break-before: auto; }
  .panels figcaption { font-size: 8.5pt; line-height: 1.35; }
  figcaption li { margin-bottom: 3px; }
  figcaption li, h2, h3 { break-inside: avoid; }
}
"""


def gallery_html(papers: Sequence[Paper]) -> tuple[str, dict[str, list[Check]]]:
    """Draw the page; return it and the checks of each paper. The same models give the same text."""
    checks: dict[str, list[Check]] = {}
    sections = []
    for paper in papers:
        figures = []
        for make in paper.figures:
            figure = make()
            figures.append((figure, _figure_html(paper, figure)))
        checks[paper.key] = [check for figure, _ in figures for check in figure.checks]
        sections.append(_paper_html(paper, figures))
    body = [_head(papers, checks), *sections]
    return html_page(_TITLE, CSS + _CSS, body), checks


def _head(papers: Sequence[Paper], checks: dict[str, list[Check]]) -> str:
    rows = [_row(paper, checks[paper.key]) for paper in papers]
    every = [check for paper in papers for check in checks[paper.key]]
    table = table_html(("Paper", "#Figures", "#Checks", "#Hold"), rows, "wide toc")
    return (
        f"<header>\n<h1>{_TITLE}</h1>\n"
        '<p class="soft">Every figure of the four papers that needs no photograph and no '
        "measurement, with the paper’s parameters. Below each stands what the paper states about "
        "it, in its text, a table or the caption, or a property that the figure must have, and "
        "what the models give: ✓ holds, ✗ does not, with the reason.</p>\n"
        f"<p>{sum(check.holds for check in every)} of {len(every)} statements hold.</p>\n</header>"
        f"\n{table}"
    )


def _row(paper: Paper, checks: Sequence[Check]) -> str:
    held = sum(check.holds for check in checks)
    name = f'<a href="#p{paper.key}">{paper.citation}</a>'
    return row_html((name, f"#{len(paper.figures)}", f"#{len(checks)}", f"#{held}"))


def _paper_html(paper: Paper, figures: Iterable[tuple[PaperFigure, str]]) -> str:
    parts = [f'<h2 id="p{paper.key}">{paper.citation}</h2>', *(html for _, html in figures)]
    return "\n".join([*parts, f'<p class="soft">Left out: {paper.left_out}</p>'])


def _figure_html(paper: Paper, figure: PaperFigure) -> str:
    name = f"f{paper.key}-{re.sub('[^0-9]+', '-', figure.number)}"
    panels = [
        f'<div class="{"picture" if panel.picture else "line"}">'
        + (f"<p>{panel.title}</p>" if panel.title else "")
        + _labelled(embedded_svg(panel.drawing, f"{name}-{k}"), paper, figure, panel.title)
        + "</div>"
        for k, panel in enumerate(figure.panels)
    ]
    caption = f"<figcaption>{figure.caption}<ul>{''.join(map(_check, figure.checks))}</ul>"
    kind = "panels odd" if len(panels) % 2 else "panels"
    length = "drawn long" if len(panels) > _LONG else "drawn"
    return (
        f'<section class="{length}">\n<h3 id="{name}"><a href="#{name}">{paper.key}, '
        f'{_numbered(figure.number)}.</a> {figure.title}</h3>\n<figure class="{kind}">\n'
        + "\n".join(panels)
        + f"\n{caption}</figcaption>\n</figure>\n</section>"
    )


def _numbered(number: str) -> str:
    return number.replace("§", "section ") if number.startswith("§") else f"Figure {number}"


def plain_text(words: str) -> str:
    """Return words in HTML without its marks, for a terminal or a reader of a screen."""
    return unescape(re.sub(r"<[^>]*>", "", words))


def _labelled(svg: str, paper: Paper, figure: PaperFigure, title: str) -> str:
    """The SVG with a label for readers of a screen."""
    words = escaped(plain_text(f"{paper.key}, {_numbered(figure.number)}: {title or figure.title}"))
    return svg.replace("<svg ", f'<svg role="img" aria-label="{words}" ', 1)


def _check(check: Check) -> str:
    kind, sign = ("holds", "✓") if check.holds else ("fails", "✗")
    remark = f' <span class="remark">{check.remark}</span>' if check.remark else ""
    said = check.said[0].upper() + check.said[1:] if check.said[0].isascii() else check.said
    return f'<li class="{kind}"><b>{sign}</b>{said}: {check.found}.{remark}</li>'
