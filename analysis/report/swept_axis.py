"""Axes that a scan may sweep: points as a position on the axis, a series of it, and a panel.

A series is drawn as one line with a colour and a marker of its own, a panel is a chart of series.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from instrument.geometry import FloatArray

# Angles that differ by less are one setting of the lamp, or one plane of the camera.
SAME_ANGLE_DEG = 0.25

Triple = tuple[FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True, slots=True, kw_only=True)
class SweptAxis:
    """Axis of the charts: its words, and how geometries are placed on it.

    label: of the axis. moves: what moves along it. side: the side of positive angles, empty where
    the axis has none. series, panel: what the angle of a series, and of a panel, is.
    place: x, series and panel (N,) of theta_i, dphi and theta_r (N,), all in degrees. angles: the
    reverse.
    """

    name: str
    symbol: str
    label: str
    moves: str
    side: str
    series: str
    panel: str
    place: Callable[[FloatArray, FloatArray, FloatArray], Triple]
    angles: Callable[[FloatArray, FloatArray, FloatArray], Triple]


def _view_place(theta_i: FloatArray, dphi: FloatArray, theta_r: FloatArray) -> Triple:
    panel, x = _folded(dphi, theta_r)
    return x, theta_i, panel


def _view_angles(x: FloatArray, series: FloatArray, panel: FloatArray) -> Triple:
    return series, panel, x


def _lamp_place(theta_i: FloatArray, dphi: FloatArray, theta_r: FloatArray) -> Triple:
    azimuth, series = _unsigned(dphi, theta_r)
    panel, x = _folded(azimuth, theta_i)
    return x, series, panel


def _lamp_angles(x: FloatArray, series: FloatArray, panel: FloatArray) -> Triple:
    return np.abs(x), np.where(x < 0, panel + 180.0, panel), series


def _azimuth_place(theta_i: FloatArray, dphi: FloatArray, theta_r: FloatArray) -> Triple:
    azimuth, series = _unsigned(dphi, theta_r)
    return _around(azimuth, 180.0), series, theta_i


def _azimuth_angles(x: FloatArray, series: FloatArray, panel: FloatArray) -> Triple:
    return panel, x, series


def _unsigned(dphi_deg: FloatArray, theta_r_deg: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The same directions with theta_r of 0 or more."""
    return np.where(theta_r_deg < 0, dphi_deg + 180.0, dphi_deg), np.abs(theta_r_deg)


def _around(angle_deg: FloatArray, last_deg: float) -> FloatArray:
    """Angles of one turn that ends at `last_deg`, and a little later because of jitter."""
    start = last_deg - 360.0 + SAME_ANGLE_DEG
    with np.errstate(invalid="ignore"):
        return np.mod(angle_deg - start, 360.0) + start


def _folded(dphi_deg: FloatArray, theta_deg: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The same directions with dphi in -90 to 90 degrees; theta changes its sign if needed."""
    around = _around(dphi_deg, 270.0)
    with np.errstate(invalid="ignore"):
        other = around > 90.0 + SAME_ANGLE_DEG
    return np.where(other, around - 180.0, around), np.where(other, -theta_deg, theta_deg)


VIEW = SweptAxis(
    name="view angle",
    symbol="θᵣ",
    label="view angle θᵣ (°)",
    moves="camera",
    side="lamp’s side",
    series="lamp at θᵢ",
    panel="Δφ",
    place=_view_place,
    angles=_view_angles,
)
LAMP = SweptAxis(
    name="lamp angle",
    symbol="θᵢ",
    label="lamp angle θᵢ (°)",
    moves="lamp",
    side="camera’s side",
    series="camera at θᵣ",
    panel="Δφ",
    place=_lamp_place,
    angles=_lamp_angles,
)
AZIMUTH = SweptAxis(
    name="azimuth",
    symbol="Δφ",
    label="azimuth Δφ (°) from the lamp’s side",
    moves="camera",
    side="",
    series="camera at θᵣ",
    panel="lamp at θᵢ",
    place=_azimuth_place,
    angles=_azimuth_angles,
)
AXES = (VIEW, LAMP, AZIMUTH)
