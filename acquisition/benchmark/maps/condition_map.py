"""Maps of the condition of a fit: which sweeps determine the parameters of a model."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from acquisition.benchmark.maps.map_style import (
    Panel,
    Reason,
    columns_of,
    draw_panels,
    joined,
    label_axes,
)
from acquisition.benchmark.result import MapPicture
from analysis.accuracy.identifiability import LIMIT, condition_map
from analysis.report.style import svg_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SAMPLES: dict[str, dict[str, float]] = {
    "oren_nayar": {"albedo": 0.8},
    "oren_nayar+torrance_sparrow": {"albedo": 0.8, "ks": 0.1},
}
"""Models that are mapped over roughness, with their other parameters."""

_INCIDENCES_DEG = ((0.0,), (30.0,), (15.0, 45.0, 75.0))
_LEVELS = (10.0, 50.0, LIMIT, 1000.0)


def condition_picture(name: str) -> MapPicture:
    """Map the condition of a fit over roughness and the largest view angle of a standard sweep."""
    largest_deg, sigma_deg = np.linspace(5, 85, 33), np.linspace(1, 59, 21)
    others = SAMPLES[name]
    sweeps = [(incidences, plane) for plane in (0.0, 90.0) for incidences in _INCIDENCES_DEG]
    found = [condition_map(name, others, list(i), p, sigma_deg, largest_deg) for i, p in sweeps]
    reasons = (Reason("views too alike to separate roughness from albedo", LIMIT),)
    panels = [
        Panel(_title(*sweep), largest_deg, sigma_deg, values, reasons)
        for sweep, values in zip(sweeps, found, strict=True)
    ]

    def draw(figure: Figure) -> None:
        axes = draw_panels(figure, 2, panels, levels=_LEVELS, unit="")
        label_axes(axes, 3, "largest view angle of the sweep (°)", "roughness σ (°)")

    others_text = ", ".join(f"{parameter} {value:g}" for parameter, value in others.items())
    caption = (
        "Condition of the Jacobian of ln(BRDF), parameters in units of their domains, for 61 view "
        f"angles shared among the incidences. Above {LIMIT:g}, points of 1 % leave the worst "
        "combination of parameters uncertain by a quarter of a domain: the fit then reports that "
        "the data do not determine it. At small σ a gloss is a narrow lobe, which a sweep must "
        f"hit. Other parameters: {others_text}."
    )
    rows = [
        columns_of(
            incidences_deg=[" ".join(f"{i:g}" for i in incidences)] * values.size,
            dphi_deg=np.full(values.shape, plane), sigma_deg=sigma_deg[:, None],
            largest_view_deg=largest_deg, condition=values,
        )
        for (incidences, plane), values in zip(sweeps, found, strict=True)
    ]  # fmt: skip
    svg = svg_of(6.2, draw, f"map_condition_{len(others)}")
    return MapPicture(f"What a sweep can determine: {name}", caption, svg, joined(rows))


def _title(incidences_deg: tuple[float, ...], dphi_deg: float) -> str:
    angles = ", ".join(f"{i:g}°" for i in incidences_deg)
    return f"θᵢ = {angles}, {'in plane' if dphi_deg == 0 else 'Δφ = 90°'}"
