"""Figures for a notebook: the report's chart of the BRDF, as a Matplotlib figure."""

from __future__ import annotations

import io
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from acquisition.results.fitting import Fitted
from acquisition.results.report_inputs import candidates
from analysis.report.data import ReportData
from analysis.report.figures.charts import brdf_drawing, model_handles
from analysis.report.style import drawn_in
from analysis.report.sweeps import group_sweeps
from instrument.errors import NoMeasurement
from instrument.geometry import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Points:
    """Points to draw, arrays (N,): angles in degrees, theta_r signed; values with their u.

    brdf, u_brdf: in 1/sr; NaN throughout where the scale is unknown. radiance, u_radiance: in a
    unit of their own. flags: empty for a good point.
    """

    theta_i_deg: FloatArray
    theta_r_deg: FloatArray
    dphi_deg: FloatArray
    brdf: FloatArray
    u_brdf: FloatArray
    radiance: FloatArray
    u_radiance: FloatArray
    flags: tuple[str, ...]


class ShownFigure(Figure):
    """Matplotlib figure that a notebook shows as a picture, without a plotting backend."""

    def _repr_png_(self) -> bytes:
        data = io.BytesIO()
        self.savefig(data, format="png", dpi=110)
        return data.getvalue()


def brdf_figure(points: Points, fitted: Fitted | None) -> Figure:
    """Draw the points of every sweep with u, and the chosen model with those next to it by BIC.

    Raises `NoMeasurement` if no point has a value.
    """
    size = len(points.flags)
    chosen = fitted is not None and fitted.choice is not None
    data = ReportData(
        title="",
        sample="",
        description="",
        verdict=(),
        verdict_kind="",
        notes=(),
        theta_i_deg=points.theta_i_deg,
        dphi_deg=points.dphi_deg,
        theta_r_deg=points.theta_r_deg,
        brdf=points.brdf,
        u_brdf=points.u_brdf,
        radiance=points.radiance,
        u_radiance=points.u_radiance,
        flags=points.flags,
        fitted=fitted.used if fitted is not None and chosen else np.zeros(size, dtype=bool),
        candidates=candidates(fitted) if fitted is not None else (),
    )
    sweeps = group_sweeps(data)
    if not sweeps:
        raise NoMeasurement("no point has a value: there is nothing to draw")
    figure = drawn_in(ShownFigure, brdf_drawing(sweeps, data.quantity))
    if data.plotted:
        names = [candidate.name for candidate in data.plotted]
        figure.axes[0].legend(handles=model_handles(names), frameon=False, fontsize=8)
    return figure
