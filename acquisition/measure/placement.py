"""Effect of a misplaced surface: it stands off the rotation axis, along its normal.

A surface that is closer to the camera and the lamp by z appears shifted in the image, so that the
window averages a neighbouring patch; and the lamp irradiates it from another distance and angle.
The first part is taken from the measured image, which holds the sample's texture and the shading
along the surface. The second is computed: no image at one height shows it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.measure.window import Window
from instrument.geometry import FloatArray, IntArray


@dataclass(frozen=True, slots=True)
class Placement:
    """Standard uncertainty of the surface's height in mm, and the lamp that shines on it.

    theta_i_deg: angle of incidence. lamp_distance_mm: from the lamp to the rotation axis.
    """

    u_mm: float
    theta_i_deg: float
    lamp_distance_mm: float

    @property
    def u_irradiance(self) -> float:
        """Relative change of the irradiance when the surface is u_mm closer to the lamp.

        Half the change from -u_mm to u_mm, of cos(theta_i) / distance^2 at the point below the
        lamp's nominal one; at most all of the light (-1), where it grazes the surface.
        """
        low, here, high = (self._irradiance(z) for z in (-self.u_mm, 0.0, self.u_mm))
        return max((high - low) / (2 * here), -1.0) if here > 0 else -1.0

    def _irradiance(self, z_mm: float) -> float:
        theta_i = np.radians(self.theta_i_deg)
        across = self.lamp_distance_mm * np.sin(theta_i)
        above = max(self.lamp_distance_mm * np.cos(theta_i) - z_mm, 0.0)
        return float(above / np.hypot(across, above) ** 3)


def tilt_deg(angle_deg: FloatArray, height_mm: float, distance_mm: float) -> FloatArray:
    """Return the change in degrees of an angle from the normal, seen from height_mm above the axis.

    angle_deg: (N,), signed, of the lamp or the camera, which is distance_mm from the axis.

    With the lamp's distance this is the change of theta_i by the surface's motion along its normal;
    its motion along the surface is in the measured image. With the beam's length it is minus the
    change of theta_r by which the shifted window differs from a shifted surface: the one looks from
    another direction, the other does not. Both are effects that `placement_u_dn` lacks, since they
    depend on the reflectance.
    """
    return np.degrees(np.sin(np.radians(angle_deg)) * height_mm / distance_mm)


def placement_u_dn(
    image: NDArray[Any],
    dark: FloatArray,
    window: Window,
    placement: Placement,
    linear: Callable[[NDArray[Any]], NDArray[Any]] = np.asarray,
) -> tuple[float, float]:
    """Return the effect in DN of a surface u_mm closer to the camera: first and second order.

    `image`: one frame, `dark`: mean dark, both (rows, columns) in DN; `linear` makes counts linear
    in light. The first is signed.
    """
    shift = np.array(window.shift_px_per_mm[::-1]) * placement.u_mm  # rows, columns
    whole = np.rint(shift).astype(int)
    if not whole.any():
        whole[np.argmax(np.abs(shift))] = 1 if shift[np.argmax(np.abs(shift))] >= 0 else -1
    box, inside = _box(window.crop, np.abs(whole), dark.shape)
    light = linear(image[box]) - dark[box]
    here = _moved(window.crop, -np.array([s.start for s in box]))
    signal = window.mean(light[here])
    irradiance = signal * placement.u_irradiance
    if not placement.u_mm or not window.inside_frame or not inside:
        return irradiance, 0.0
    part = float(np.linalg.norm(shift) / np.linalg.norm(whole))
    # The window is shifted over the measured image by the shift of the image, to both sides.
    before, after = (window.mean(light[_moved(here, by * whole)]) for by in (-1, 1))
    first = -part * (after - before) / 2
    # A normal displacement x of standard uncertainty u has rms(x^2) = sqrt(3) u^2.
    second = part**2 * np.sqrt(3) * abs(after + before - 2 * signal) / 2
    return first + irradiance, second


def _box(
    crop: tuple[slice, slice], margin: IntArray, shape: tuple[int, ...]
) -> tuple[tuple[slice, slice], bool]:
    """Return a crop with a margin (rows, columns) around it; without one where that leaves shape.

    The second is False then.
    """
    wide = [slice(s.start - n, s.stop + n) for s, n in zip(crop, margin.tolist(), strict=True)]
    inside = all(s.start >= 0 and s.stop <= size for s, size in zip(wide, shape, strict=True))
    return ((wide[0], wide[1]) if inside else crop), inside


def _moved(crop: tuple[slice, slice], by: IntArray) -> tuple[slice, slice]:
    rows, columns = (slice(s.start + n, s.stop + n) for s, n in zip(crop, by.tolist(), strict=True))
    return rows, columns
