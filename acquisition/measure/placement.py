"""Effect of a misplaced surface: it stands off the rotation axis, along its normal.

A surface that is closer to the camera and the lamp by z appears shifted in the image, so that the
window averages a neighbouring patch; and the lamp irradiates it from another distance and angle.
The first part is taken from the measured image, which holds the sample's texture and the shading
along the surface. The second is computed: no image at one height shows it.
"""

from __future__ import annotations

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
    image: NDArray[Any], dark: FloatArray, window: Window, placement: Placement
) -> tuple[float, float]:
    """Return the effect in DN of a surface u_mm closer to the camera: first and second order.

    `image`: one frame, `dark`: mean dark, both (rows, columns) in DN. The first is signed.
    """
    first, second = _shifted_window(image, dark, window, placement.u_mm)
    signal = window.mean(image[window.crop] - dark[window.crop])
    return first + signal * placement.u_irradiance, second


def _shifted_window(
    image: np.ndarray, dark: FloatArray, window: Window, u_mm: float
) -> tuple[float, float]:
    """Return how the window's mean changes by the shift of the image: first and second order.

    Estimated by shifting the window over the measured image by the same amount, to both sides.
    """
    shift = np.array(window.shift_px_per_mm[::-1]) * u_mm  # rows, columns
    whole = np.rint(shift).astype(int)
    if not whole.any():
        whole[np.argmax(np.abs(shift))] = 1 if shift[np.argmax(np.abs(shift))] >= 0 else -1
    ahead, behind = (_moved(window.crop, by * whole) for by in (1, -1))
    inside = all(
        s.start >= 0 and s.stop <= size
        for crop in (ahead, behind)
        for s, size in zip(crop, dark.shape, strict=True)
    )
    if not u_mm or not window.inside_frame or not inside:
        return 0.0, 0.0
    part = float(np.linalg.norm(shift) / np.linalg.norm(whole))
    before, here, after = (
        window.mean(image[crop] - dark[crop]) for crop in (behind, window.crop, ahead)
    )
    # A normal displacement x of standard uncertainty u has rms(x^2) = sqrt(3) u^2.
    return -part * (after - before) / 2, part**2 * np.sqrt(3) * abs(after + before - 2 * here) / 2


def _moved(crop: tuple[slice, slice], by: IntArray) -> tuple[slice, slice]:
    rows, columns = (slice(s.start + n, s.stop + n) for s, n in zip(crop, by.tolist(), strict=True))
    return rows, columns
