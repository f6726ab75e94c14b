"""Uncertainty of frames that were exposed while theta_r turned: blur in angle, and the mean angle.

Blur. A frame over the angle w shows the mean of the radiance f, which exceeds that at its middle by
f'' w^2 / 24 (`acquisition.plan.flight`). A fit averages its model over w
(`analysis.fit.acceptance_average`). The values themselves are not corrected: for those who read
them, the term counts as a standard uncertainty, with f'' from each reading and its two neighbours
in the sweep.

Angle. The error of a time stamp differs from frame to frame. That of the latency is one for all
frames of an exposure and changes its sign with the direction of the turn. What they do to the value
depends on the slope of the model, which a fit knows.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from analysis.data.measurements import SharedError
from instrument.geometry import FloatArray
from instrument.record.reading import Reading

BLUR, ANGLE, LATENCY = "blur in angle", "angle of a moving frame", "latency of the frames"


def turning_errors(
    points: Sequence[Reading], value: FloatArray
) -> tuple[dict[str, FloatArray], tuple[SharedError, ...]]:
    """Return independent relative u by name, (N,), and shared errors, of values (N,) in any unit.

    Both are empty where no frame was taken in motion.
    """
    if not any(point.blur_deg for point in points):
        return {}, ()
    none, alone = np.zeros(len(points)), np.arange(len(points))
    exposures = np.unique([p.exposure_s for p in points], return_inverse=True)[1]
    u_turn, u_latency = (
        np.array([getattr(p, name) for p in points]) for name in ("u_turn_deg", "u_latency_deg")
    )
    shared = (
        SharedError(ANGLE, none, alone, theta_r_deg=u_turn),
        SharedError(LATENCY, none, exposures.astype(np.int64), theta_r_deg=u_latency),
    )
    return {BLUR: smear(points, value)}, shared


def turning_note(points: Sequence[Reading]) -> str:
    """Return how the points were measured in motion, in one sentence; empty if none was."""
    blur_deg = max((point.blur_deg for point in points), default=0.0)
    if not blur_deg:
        return ""
    u_deg = max(abs(point.u_latency_deg) for point in points)
    return (
        f"theta_r turned while its frames were taken, by up to {blur_deg:.2g} deg in one exposure; "
        f"angles are the mean ones, with a u of {u_deg:.2g} deg by the latency between camera and "
        "axis"
    )


def smear(points: Sequence[Reading], value: FloatArray) -> FloatArray:
    """Relative change of values (N,), in any unit, by the curvature in each frame, without sign."""
    relative = np.zeros(len(points))
    angles = np.array([p.theta_r_deg for p in points])
    blur = np.array([p.blur_deg for p in points])
    settings = np.array([p.lamp_setting for p in points])
    for setting in np.unique(settings):
        own = np.flatnonzero(settings == setting)
        own = own[np.argsort(angles[own])]
        if own.size < 3:
            continue
        bend = _second_derivative(angles[own], value[own])
        change = bend * blur[own] ** 2 / 24
        relative[own] = np.abs(change) / np.where(value[own] == 0, np.nan, np.abs(value[own]))
    return relative


def _second_derivative(x: FloatArray, y: FloatArray) -> FloatArray:
    """Second derivative (N,) by divided differences; at the ends that of the neighbour."""
    slope = np.diff(y) / np.maximum(np.diff(x), 1e-6)
    inner = 2 * np.diff(slope) / (x[2:] - x[:-2])
    return np.concatenate([inner[:1], inner, inner[-1:]])
