"""Best model of a run so far: its name, its verdict, and its line along each curve."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from acquisition.live.following.curves import Curves
from acquisition.live.following.messages import rounded
from acquisition.results.fitting import Fitted, fit_run
from acquisition.results.reduction import Reduced
from acquisition.results.summary import parameters_of, value_text
from analysis.fit.fit import FitResult
from analysis.fit.relative_scale import normalise_lamp_levels
from instrument.config.load import Loaded
from instrument.geometry import FloatArray, Geometry
from instrument.record.reading import Reading

_MOST_VALUES = 20_000  # of all lines together
_DENSE, _SPARSE = 241, 31  # places along one line
_DIGITS = 5
_ADVICE = ": resume the scan"  # of a run that is not being measured
_NO_LEVEL = "no line where the lamp is moved along a curve: its level is free without a tile"


def model_content(reduced: Reduced, loaded: Loaded, curves: Curves) -> dict[str, Any]:
    """Fit what has been measured and return the message about it; it takes seconds."""
    fitted = fit_run(reduced, loaded)
    chosen = fitted.chosen
    if fitted.choice is None or chosen is None:
        text = fitted.reason.removesuffix(_ADVICE)
        return {"name": None, "text": text, "verdict": None, "points": 0, "lines": []}
    lines, levelled = _lines(reduced, fitted, chosen, curves)
    verdict, parameters = fitted.choice.verdict, parameters_of(chosen)
    text = f"{chosen.model}, {verdict}: "
    text += ", ".join(f"{p.name} {value_text(p)}" for p in parameters)
    return {
        "name": chosen.model,
        "text": text if levelled else f"{text} ({_NO_LEVEL})",
        "verdict": verdict,
        "points": int(np.count_nonzero(fitted.used)),
        "lines": lines,
    }


def _lines(
    reduced: Reduced, fitted: Fitted, chosen: FitResult, curves: Curves
) -> tuple[list[dict[str, Any]], bool]:
    """Return the lines of all curves that have one, and whether all have."""
    groups: dict[str, list[Reading]] = {}
    for point in reduced.points:
        groups.setdefault(curves.name_of(point), []).append(point)
    places = max(_SPARSE, min(_DENSE, _MOST_VALUES // len(groups)))
    x_deg = np.linspace(*curves.range_deg, places) if np.ptp(curves.range_deg) else None
    lines: list[dict[str, Any]] = []
    for name, points in groups.items():
        along = x_deg if x_deg is not None else np.array(curves.range_deg[:1])
        factor = _factor(points, along, reduced, fitted, chosen, curves)
        if factor is not None:
            values = factor * chosen.brdf(_geometry(points[0], along, curves))
            lines.append({"curve": name, **dict(_drawn(along, values))})
    return lines, len(lines) == len(groups)


def _drawn(x_deg: FloatArray, values: FloatArray) -> Iterator[tuple[str, list[float | None]]]:
    yield "x_deg", [rounded(x, _DIGITS) for x in x_deg.tolist()]
    yield "value", [rounded(v, _DIGITS) for v in values.tolist()]


def _geometry(point: Reading, x_deg: FloatArray, curves: Curves) -> Geometry:
    """Return the geometries (N,) along the curve of a point; x_deg: (N,) in degrees."""
    angles: dict[str, float | FloatArray] = {
        "theta_i": point.theta_i_deg, "theta_r": point.theta_r_deg, "dphi": point.dphi_deg,
        curves.sweep: x_deg,
    }  # fmt: skip
    return Geometry.from_degrees(**angles)


def _factor(
    points: Sequence[Reading],
    x_deg: FloatArray,
    reduced: Reduced,
    fitted: Fitted,
    chosen: FitResult,
    curves: Curves,
) -> float | FloatArray | None:
    """Return the value that is shown over the model's BRDF, (N,) or one for all.

    Radiance without a white tile is the BRDF times cos(theta_i) and the lamp's level at its
    setting, which the fit leaves free. None where one curve has points of several settings.
    """
    m = fitted.measurements
    if reduced.has_brdf or m is None:
        return 1.0
    settings = {point.lamp_setting for point in points}
    own = np.isin(m.lamp_setting, list(settings))
    if len(settings) > 1 or not np.any(own):
        return None
    level = float((m.brdf / normalise_lamp_levels(m, chosen.brdf).brdf)[own][0])
    theta_i_deg = x_deg if curves.sweep == "theta_i" else points[0].theta_i_deg
    return level * np.cos(np.radians(theta_i_deg))
