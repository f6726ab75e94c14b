"""Latency between the axis and the camera, from a turn there and back over the same angles.

If the time stamps of the frames are late by tau against the positions, a frame that is taken at the
speed v (signed) shows the scene not at the angle that was reported but at v tau beyond it. A
feature of the picture that depends on the angle alone, F(theta), is therefore seen v tau too early
in one direction and as much too late in the other: half the distance of its two courses is |v| tau.
What the play of the gear adds between the directions is found with it, and is shared half and half.

The feature is the area of the sample in the picture, in which it is foreshortened: the sum of the
counts without the dark, each no larger than a level that the whole sample exceeds. Pixels at the
edges count by the share that is covered; how bright the sample is in each direction and at each
place, and noise, hardly matter. A sample without edges in view has no such feature.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
from numpy.polynomial import Polynomial

from acquisition.engine.fly.turning import Shot
from acquisition.measure.radiometry import Dark
from acquisition.measure.window import Window
from instrument.config.camera import CameraConfig
from instrument.errors import DeviceError
from instrument.geometry import FloatArray

DEGREE = 3  # of the polynomial in the angle that gives the feature's slope
LEVEL = 0.8  # of the darkest picture of the patch
_LEAST_PAIRS = 6
_ROUNDS = 4  # slope and latency depend little on one another
_MOST_U_DEG = 0.1  # of an angle: more would be no calibration


@dataclass(frozen=True, slots=True)
class Course:
    """Reported angles (N,) in degrees and a feature (N,), at one signed speed in deg/s."""

    angles_deg: FloatArray
    feature: FloatArray
    speed_deg_per_s: float

    def moved(self, latency_s: float) -> Course:
        """Return the course at the angles that a latency leads to."""
        return replace(self, angles_deg=self.angles_deg + self.speed_deg_per_s * latency_s)


@dataclass(frozen=True, slots=True)
class Latency:
    """Time by which frames are late against positions, its u, and the u of one angle, 1 sigma.

    `u_angle_deg` (independent from frame to frame): scatter of the feature between both directions.
    """

    value_s: float
    u_s: float
    u_angle_deg: float
    frames: int

    def text(self, exposure_s: float) -> str:
        """Return the result in words, for the record."""
        return (
            f"latency between camera and theta_r at an exposure of {exposure_s:g} s: "
            f"{1e3 * self.value_s:.3f} ms, u {1e3 * self.u_s:.3f} ms, from {self.frames} frames "
            f"there and back, whose angles scatter by {self.u_angle_deg:.4f} deg"
        )


def bright_area_px(shot: Shot, dark: Dark, level_dn: float, camera: CameraConfig) -> float:
    """Return the area of what is brighter than `level_dn` above the dark, in pixels."""
    light = camera.linear_dn(shot.frame.image) - dark.mean
    return float(np.clip(light, 0.0, level_dn).sum() / level_dn)


def fit_latency(there: Course, back: Course) -> Latency:
    """Return the latency that lets both directions see the same feature at the same angle.

    Each frame there is compared with the one back at the nearest reported angle: what the picture's
    pixels do to the feature is then in both. With the slope g' of the feature at the angles that
    the latency tau leads to, and these angles a, their difference is g' (a_back - a_there): least
    squares for tau, whose u has two parts: the residuals, of which neighbours may agree, so that
    half of them count, and the slope's own u. Raises `DeviceError` where tau is not determined.
    """
    nearest = np.argmin(np.abs(there.angles_deg[:, np.newaxis] - back.angles_deg), axis=1)
    apart = back.angles_deg[nearest] - there.angles_deg
    pairs = np.abs(apart) < np.abs(np.diff(there.angles_deg)).min(initial=np.inf) / 2
    change = (back.feature[nearest] - there.feature)[pairs]
    apart, middle = apart[pairs], (there.angles_deg + apart / 2)[pairs]
    if change.size < _LEAST_PAIRS or not np.all(np.isfinite(change)):
        raise DeviceError(
            f"theta_r: {change.size} pairs of frames of the turn there and back show the sample; "
            f"the latency needs {_LEAST_PAIRS}: look at the light and the camera"
        )
    turned, tau_s = back.speed_deg_per_s - there.speed_deg_per_s, 0.0
    for _ in range(_ROUNDS):
        slope, u_slope = _slope(there.moved(tau_s), back.moved(tau_s), middle)
        squares = float(slope @ slope)
        if not squares > 0:
            raise _no_feature(middle, math.inf)
        tau_s = float(slope @ (change - slope * apart)) / (squares * turned)
    residual = change - slope * (apart + turned * tau_s)
    sigma = float(np.sqrt(2 * (residual @ residual) / (change.size - 1)))
    u_s = math.hypot(sigma / turned, tau_s * u_slope * math.sqrt(change.size)) / math.sqrt(squares)
    if not u_s * abs(turned) / 2 <= _MOST_U_DEG:
        raise _no_feature(middle, u_s * abs(turned) / 2)
    u_angle = sigma / math.sqrt(2 * squares / change.size)
    return Latency(tau_s, u_s, u_angle, 2 * change.size)


def _slope(there: Course, back: Course, at_deg: FloatArray) -> tuple[FloatArray, float]:
    """Slope of the feature per degree at angles (N,), and the u of its mean.

    From a polynomial through both courses, and as the u of a straight line's slope.
    """
    angles = np.concatenate([there.angles_deg, back.angles_deg])
    feature = np.concatenate([there.feature, back.feature])
    course = Polynomial.fit(angles, feature, DEGREE)
    residual = feature - course(angles)
    variance = float(residual @ residual) / (angles.size - DEGREE - 1)
    u = math.sqrt(variance / (angles.size * float(np.var(angles))))
    return np.asarray(course.deriv()(at_deg)), u


def _no_feature(angles_deg: FloatArray, u_deg: float) -> DeviceError:
    return DeviceError(
        "theta_r: the latency between axis and camera cannot be found: the picture does not change "
        f"enough from {angles_deg.min():.1f} to {angles_deg.max():.1f} deg (u of an angle "
        f"{u_deg:.2g} deg; allowed: {_MOST_U_DEG:g} deg). Let edges of the sample be in the "
        "picture, sweep to larger view angles, or measure with motion: stepped"
    )


def latency_of(
    turns: tuple[Sequence[Shot], Sequence[Shot]],
    window_at: Callable[[float], Window],
    dark: Dark,
    camera: CameraConfig,
) -> Latency:
    """Return the latency from the frames of a turn there and of one back.

    window_at: the window of the patch at an angle in degrees.
    """
    patches = []
    for shot in chain(*turns):
        window = window_at(shot.reported_deg)
        light = camera.linear_dn(shot.frame.image) - dark.mean
        patches.append(np.median(light[window.crop][window.counted]))
    level_dn = LEVEL * float(min(patches, default=np.nan))
    there, back = (_course(shots, dark, level_dn, camera) for shots in turns)
    return fit_latency(there, back)


def _course(shots: Sequence[Shot], dark: Dark, level_dn: float, camera: CameraConfig) -> Course:
    seen = [bright_area_px(s, dark, level_dn, camera) if level_dn > 0 else np.nan for s in shots]
    return Course(
        np.array([shot.reported_deg for shot in shots]),
        np.array(seen),
        shots[0].speed_deg_per_s if shots else 0.0,
    )
