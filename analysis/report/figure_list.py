"""Figures of a report in their order: heading, caption, and drawings for two widths."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from analysis.report import captions
from analysis.report.data import ReportData
from analysis.report.figures import charts
from analysis.report.figures.budget_chart import budget_drawing, with_budget
from analysis.report.figures.drift_chart import drift_drawing
from analysis.report.figures.hemisphere import hemisphere_drawing, hemisphere_maps
from analysis.report.figures.polar import polar_drawing
from analysis.report.style import Drawing, embedded_svg, escaped, figure_html
from analysis.report.sweeps import PlottedSweep
from analysis.report.swept_axis import VIEW

Draw = Callable[..., Drawing]


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportFigure:
    """Figure of a report. `name`: of its file, and of its place in the page.

    heading, caption: in HTML. label: for readers of a screen. drawings: with `narrow`, for a phone.
    """

    name: str
    heading: str
    label: str
    caption: str
    drawings: Callable[[bool], list[Drawing]]

    def section_html(self) -> str:
        """Return the figure under its heading."""
        return f'<h2 id="{self.name}">{self.heading}</h2>\n{self.html()}'

    def html(self) -> str:
        """Return the figure drawn for both widths; the page shows one of them."""
        wide, narrow = (
            [embedded_svg(d, f"{self.name}{size}{n}") for n, d in enumerate(self.drawings(small))]
            for size, small in (("", False), ("-narrow", True))
        )
        return figure_html(wide, self.label, self.caption, narrow)


def chart_figures(data: ReportData, sweeps: tuple[PlottedSweep, ...]) -> list[ReportFigure]:
    """Return the figures of what was measured; none without a value."""
    if not sweeps:
        return []
    name, quantity = data.measured.title, data.quantity
    found = [
        ReportFigure(
            name="shape",
            heading="Shape of the reflection",
            label=f"shape against the {sweeps[0].axis.name}",
            caption=captions.shape_caption(data, sweeps, quantity),
            drawings=lambda narrow: charts.shape_drawings(sweeps, quantity, narrow=narrow),
        ),
        ReportFigure(
            name="brdf",
            heading=captions.brdf_title(sweeps, name),
            label=quantity,
            caption=captions.panel_caption(data, sweeps),
            drawings=_one(partial(charts.brdf_drawing, sweeps, quantity)),
        ),
    ]
    if sweeps[0].axis is VIEW:
        found.append(
            ReportFigure(
                name="polar",
                heading=f"{name} around the sample",
                label=f"{quantity}, polar",
                caption=captions.polar_caption(data, sweeps, quantity),
                drawings=_one(partial(polar_drawing, sweeps, quantity)),
            )
        )
    if maps := hemisphere_maps(data):
        found.append(
            ReportFigure(
                name="hemisphere",
                heading=f"{name} in the hemisphere above the sample",
                label=f"{quantity} in the hemisphere",
                caption=captions.hemisphere_caption(data, maps, escaped(quantity)),
                drawings=_one(partial(hemisphere_drawing, maps, quantity)),
            )
        )
    return found


def budget_figure(data: ReportData, sweeps: tuple[PlottedSweep, ...]) -> ReportFigure | None:
    """Return the figure of the uncertainty by source, None where no sweep has a budget."""
    known = with_budget(data, sweeps) if data.budget else ()
    if not known:
        return None
    return ReportFigure(
        name="budget",
        heading="Uncertainty budget",
        label="uncertainty by source",
        caption=captions.budget_caption(known),
        drawings=_one(partial(budget_drawing, data, known)),
    )


def drift_figure(data: ReportData) -> ReportFigure | None:
    """Return the figure of the lamp's level, None where it was not checked."""
    if not data.lamp:
        return None
    return ReportFigure(
        name="drift",
        heading="Drift of the lamp",
        label="level of the lamp against time",
        caption=captions.drift_caption(data.lamp),
        drawings=_one(partial(drift_drawing, data.lamp)),
    )


def _one(draw: Draw) -> Callable[[bool], list[Drawing]]:
    return lambda narrow: [draw(narrow=narrow)]
