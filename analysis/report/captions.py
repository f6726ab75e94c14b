"""Captions of the report's charts, in HTML."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from analysis.report.data import LampLevels, ReportData
from analysis.report.figures import charts
from analysis.report.figures.hemisphere import HemisphereMap
from analysis.report.style import escaped
from analysis.report.sweeps import PlottedSweep
from analysis.report.swept_axis import LAMP, VIEW

Sweeps = tuple[PlottedSweep, ...]

_MOST_LISTED = 8  # angles; more are counted


def counts(data: ReportData, sweeps: Sweeps) -> str:
    """Numbers of geometries, angles, and points in the fit."""
    number = len(data.flags)
    measured = "1 geometry" if number == 1 else f"{number} geometries"
    parts = [f"{measured} measured", *(_angles(sweeps) if sweeps else ())]
    parts.append(f"{int(data.fitted.sum())} in the fit")
    flagged = int(data.flagged.sum())
    parts.append(f"<b>{flagged} flagged</b>" if flagged else "none flagged")
    return " · ".join(part for part in parts if part)


def _angles(sweeps: Sweeps) -> list[str]:
    axis = sweeps[0].axis
    ends = min(float(s.x_deg[0]) for s in sweeps), max(float(s.x_deg[-1]) for s in sweeps)
    swept = f"{axis.name} {axis.symbol} from {ends[0]:.4g}° to {ends[1]:.4g}°".replace("-", "−")
    return [
        f"{axis.series.split(' at ')[0]} at {_listed(sweeps, lambda s: s.shown_series_deg)}",
        swept if ends[0] < ends[1] else "",
        _panels(sweeps),
    ]


def _panels(sweeps: Sweeps) -> str:
    number = len({s.panel for s in sweeps})
    if number == 1 and sweeps[0].in_plane:
        return ""
    listed = _listed(sweeps, lambda s: s.shown_panel_deg)
    of_lamp = sweeps[0].axis.panel.startswith("lamp")
    return f"lamp at {listed}" if of_lamp else f"planes Δφ = {listed}"


def _listed(sweeps: Sweeps, angle: Callable[[PlottedSweep], float]) -> str:
    found = sorted({angle(s) for s in sweeps})
    if len(found) <= _MOST_LISTED:
        return ", ".join(f"{a:g}°" for a in found)
    return f"{len(found)} angles from {found[0]:g}° to {found[-1]:g}°"


def brdf_title(sweeps: Sweeps, name: str) -> str:
    """Title of the charts of single sweeps."""
    each = {VIEW: "incidence", LAMP: "view angle"}.get(sweeps[0].axis, "pair of angles")
    return f"{name} at each {each}"


def shape_caption(data: ReportData, sweeps: Sweeps, quantity: str) -> str:
    """Caption of the charts against the swept angle."""
    axis = sweeps[0].axis
    what = (
        "Radiance relative to its value along the sample’s normal (θᵣ = 0)"
        if axis is VIEW
        else quantity[:1].upper() + quantity[1:]
    )
    caption = [
        f"{what}, against the {axis.name}. Error bars: standard uncertainty u (k = 1), often "
        "smaller than the markers. The axis of the values need not begin at zero."
    ]
    caption += [f"Positive {axis.symbol} is the {axis.side}."] if axis.side else []
    if any(s.in_plane for s in sweeps):
        fixed = "lamp’s direction, θᵣ = θᵢ" if axis is VIEW else "camera’s direction, θᵢ = θᵣ"
        caption.append(f"▼ marks the {fixed}.")
    if axis.side and any(not s.in_plane for s in sweeps):
        caption.append(f"Δφ is the azimuth of positive {axis.symbol} from the {axis.side}.")
    if axis is not VIEW and not data.has_brdf:
        caption.append(
            "Without a white tile the fit takes the lamp’s level at each of its settings as "
            "unknown: a deviation that follows the lamp is no misfit."
        )
    return " ".join([*caption, *_model_captions(data), *_thinned(sweeps), _marker_caption(data)])


def _model_captions(data: ReportData) -> list[str]:
    caption = []
    if data.plotted:
        caption.append(
            f"Lines: <b>{escaped(data.plotted[0].name)}</b>{_scaled(data)}. Deviation: "
            "measured / line − 1, with bars of u; an error that points share moves them together."
        )
    if any(c.chosen and c.residuals is not None for c in data.candidates):
        caption.append(
            "Residual: (measured − model) / u, less the most likely values of the errors that "
            "points share (tile, lamp angle, placement). About 95 % should lie in the grey "
            "band of ±2. A pattern over many points is not noise but a misfit of the model."
        )
    return caption


def _thinned(sweeps: Sweeps) -> list[str]:
    shown = charts.thinned_series(sweeps)
    numbers = {
        "series": (len({s.series for s in shown}), len({s.series for s in sweeps})),
        "planes": (len({s.panel for s in shown}), len({s.panel for s in sweeps})),
    }
    return [f"{some} of {all_} {name} are shown." for name, (some, all_) in numbers.items()
            if some < all_]  # fmt: skip


def panel_caption(data: ReportData, sweeps: Sweeps) -> str:
    """Caption of the charts of single sweeps."""
    kinds = ("Solid line", "Dashed", "Dotted")
    models = data.plotted
    lines = [f"{kind}: <b>{escaped(c.name)}</b>" for kind, c in zip(kinds, models, strict=False)]
    if lines:
        lines[0] += " (chosen)" if models[0].chosen else ""
        lines = [f"{'; '.join(lines)}{_scaled(data)}."]
    if len(sweeps) > charts.MAX_SWEEPS:
        lines.append(f"{charts.MAX_SWEEPS} of {len(sweeps)} sweeps are shown.")
    if models and models[0].residuals is not None:
        lines.append("Points may deviate from a line together, by an error that they share.")
    return " ".join(["Error bars: u (k = 1).", *lines, _marker_caption(data)])


def polar_caption(data: ReportData, sweeps: Sequence[PlottedSweep], quantity: str) -> str:
    """Caption of the polar chart."""
    caption = (
        f"Radius: {quantity}; angle: direction of the camera, with θᵣ = 0 at the top and the "
        "lamp’s side on the right. A matte (Lambertian) sample would give a half circle."
    )
    caption += " Arrows: direction of the light." if any(s.in_plane for s in sweeps) else ""
    return caption + (" Flagged points are left out." if data.flagged.any() else "")


def hemisphere_caption(data: ReportData, maps: Sequence[HemisphereMap], quantity: str) -> str:
    """Caption of the maps of the hemisphere."""
    caption = (
        f"Colour: {quantity}. Each dot is a measured direction, seen from above: the distance "
        "from the centre is sin θᵣ, with rings at θᵣ = 30°, 60° and 90°; the azimuth Δφ counts "
        "from the lamp’s side on the right. ☆: direction of the lamp. Nothing is interpolated."
    )
    incidences = len({round(float(a), 1) for a in data.theta_i_deg})
    if len(maps) < incidences:
        caption += f" {len(maps)} of {incidences} incidences are shown."
    return caption + (" Crosses: flagged points." if data.flagged.any() else "")


def _scaled(data: ReportData) -> str:
    return "" if data.absolute else ", each scaled to its points"


def _marker_caption(data: ReportData) -> str:
    caption = "Crosses: flagged points; outliers may lie outside." if data.flagged.any() else ""
    left_out = ~data.fitted & ~data.flagged
    if left_out.any() and data.fitted.any():
        caption += " Open markers: points not in the fit."
    return caption.strip()


def budget_caption(sweeps: Sweeps) -> str:
    """Key to the chart of the uncertainty budget."""
    return (
        f"The top is the standard uncertainty of a point at that {sweeps[0].axis.name}; each band "
        "is as high as its share of the variance. Sources of one kind are combined."
    )


def drift_caption(lamps: Sequence[LampLevels]) -> str:
    """Caption of the chart of the lamp's level."""
    jumps = sum(len(set(one.stretch.tolist())) - 1 for one in lamps)
    jumped = "1 jump of" if jumps == 1 else f"{jumps} jumps of"
    return (
        "Each point is a repeated reading of one geometry, relative to the first; bars: u (k = 1) "
        "from noise. The readings between two checks are corrected along the lines."
        + (f" {jumped} the lamp while the scan was interrupted: no line there." if jumps else "")
    )
