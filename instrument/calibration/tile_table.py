"""Radiance factor of a white tile on a grid of angles, interpolated linearly in each angle.

beta(theta_i, theta_r, dphi) is the radiance of the tile over that of a perfect diffuser in the same
light: its BRDF times pi, above 1 in some directions (Nicodemus et al. 1977). Neither reciprocity
nor a smooth shape is assumed, but that the tile has no grain: a turn about its normal and a mirror
image change nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import product

import numpy as np

from instrument.errors import InputError
from instrument.geometry import FloatArray

ANGLES = ("theta_i_deg", "theta_r_deg", "dphi_deg")
CORNERS = 2 ** len(ANGLES)
_SAME_DEG = 1e-6


class OutsideTable(InputError):
    """A geometry outside the table; the message names the angle, its value and the range."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TileValue:
    """Interpolated radiance factor of one geometry, and the parts of its standard uncertainty.

    corners: (CORNERS,), numbers of the values in the table between which it lies. u_corners:
    (CORNERS,), part of the u of each, 0 where it does not count. Two geometries never have the same
    value of the table at different places in `corners`. u_common: of the error that all values of
    the table share. u_between: of the interpolation, 0 at the table's own angles. cell: number of
    the cell, in which the error of the interpolation is about the same.
    """

    beta: float
    corners: tuple[int, ...]
    u_corners: tuple[float, ...]
    u_common: float
    u_between: float
    cell: int


@dataclass(frozen=True, slots=True)
class TileTable:
    """Radiance factors on a complete grid of angles; two tables of the same text are equal.

    axes_deg: theta_i (I,), signed theta_r (R,) and dphi (D,), rising, in degrees; one value of an
    axis is enough where a scan needs no other. beta, u_beta, u_common: (I, R, D); `u_beta` is the
    standard uncertainty of each value by itself, `u_common` that of an error that all share.
    text: of the file.
    """

    axes_deg: tuple[FloatArray, FloatArray, FloatArray] = field(compare=False)
    beta: FloatArray = field(compare=False)
    u_beta: FloatArray = field(compare=False)
    u_common: FloatArray = field(compare=False)
    text: str = ""

    def at(self, theta_i_deg: float, theta_r_deg: float, dphi_deg: float) -> TileValue:
        """Return the radiance factor of a geometry, theta_r signed, in degrees.

        Raises `OutsideTable`.
        """
        cells = self._cells(theta_i_deg, theta_r_deg, dphi_deg)
        corners, u_corners = self._corners(cells)
        return TileValue(
            beta=_interpolated(self.beta, cells),
            corners=corners,
            u_corners=u_corners,
            u_common=_interpolated(self.u_common, cells),
            u_between=float(np.linalg.norm([self._u_between(k, cells) for k in range(3)])),
            cell=int(np.ravel_multi_index([before for before, _ in cells], self.beta.shape)),
        )

    def _cells(
        self, theta_i_deg: float, theta_r_deg: float, dphi_deg: float
    ) -> tuple[tuple[int, float], ...]:
        """Return the index of the table's angle before each angle, and the share of the next."""
        asked = (theta_i_deg, theta_r_deg, dphi_deg)
        for form in self._forms(*asked):
            found = [_cell(axis, angle) for axis, angle in zip(self.axes_deg, form, strict=True)]
            if all(cell is not None for cell in found):
                return tuple(cell for cell in found if cell is not None)
        raise OutsideTable(self._outside(asked))

    def _forms(
        self, theta_i_deg: float, theta_r_deg: float, dphi_deg: float
    ) -> Iterator[tuple[float, float, float]]:
        """Yield the angles of one direction in the ways that a table may state them.

        theta_r has a sign or dphi has its half turn; a mirror image is the same; along the normal
        any dphi is the same.
        """
        turns = np.array([0.0, -360.0, 360.0])
        for sign in (1.0, -1.0):
            turned = dphi_deg if sign > 0 else dphi_deg + 180.0
            dphis = [mirror * turned % 360.0 + turn for mirror in (1, -1) for turn in turns]
            if theta_i_deg == 0 or theta_r_deg == 0:
                dphis = [float(self.axes_deg[2][0])]
            for dphi in dphis:
                yield theta_i_deg, sign * theta_r_deg, dphi

    def _outside(self, asked: tuple[float, float, float]) -> str:
        """Return which of the angles is outside, each by itself; or all three."""
        forms = list(self._forms(*asked))
        for k, (name, axis) in enumerate(zip(ANGLES, self.axes_deg, strict=True)):
            if all(_cell(axis, form[k]) is None for form in forms):
                low, high = axis[0], axis[-1]
                only = f"only {low:g} deg" if low == high else f"{low:g} to {high:g} deg"
                return f"{name.removesuffix('_deg')} {asked[k]:g} deg; the table has {only}"
        ranges = (
            f"{name.removesuffix('_deg')} {axis[0]:g} to {axis[-1]:g} deg"
            for name, axis in zip(ANGLES, self.axes_deg, strict=True)
        )
        values = ", ".join(f"{angle:g}" for angle in asked)
        return f"theta_i, theta_r, dphi {values} deg; the table has {', '.join(ranges)} together"

    def _corners(
        self, cells: tuple[tuple[int, float], ...]
    ) -> tuple[tuple[int, ...], tuple[float, ...]]:
        """Return the values around a geometry, each at the place of the parity of its indices."""
        numbers, parts = [0] * CORNERS, [0.0] * CORNERS
        for corner in product((0, 1), repeat=len(cells)):
            share = np.prod([t if c else 1 - t for c, (_, t) in zip(corner, cells, strict=True)])
            if share > 0:
                index = tuple(before + c for c, (before, _) in zip(corner, cells, strict=True))
                place = sum((i % 2) << k for k, i in enumerate(index))
                numbers[place] = int(np.ravel_multi_index(index, self.beta.shape))
                parts[place] = float(share * self.u_beta[index])
        return tuple(numbers), tuple(parts)

    def _u_between(self, k: int, cells: tuple[tuple[int, float], ...]) -> float:
        """Return the standard uncertainty of the linear interpolation in angle `k`.

        The remainder is share * (1 - share) / 2 of the second difference over the cell (Newton's
        formula), which the neighbouring values show; the larger of both sides counts. Two values
        show none: then it is that share of their whole difference (assumed).
        """
        axis, (before, share) = self.axes_deg[k], cells[k]
        if not 0 < share < 1:
            return 0.0
        across = [cell for m, cell in enumerate(cells) if m != k]
        line = np.array([_interpolated(part, across) for part in np.moveaxis(self.beta, k, 0)])
        slopes = np.diff(line) / np.diff(axis)
        width = axis[before + 1] - axis[before]
        bends = 2 * np.diff(slopes) / (axis[2:] - axis[:-2]) * width**2
        near = np.abs(bends[max(before - 1, 0) : before + 1])
        bend = float(near.max()) if near.size else 2 * abs(float(line[1] - line[0]))
        return share * (1 - share) / 2 * bend


def _cell(axis: FloatArray, angle: float) -> tuple[int, float] | None:
    """Return the index of the angle before, and the share of the next; None outside the axis."""
    if not axis[0] - _SAME_DEG <= angle <= axis[-1] + _SAME_DEG:
        return None
    nearest = int(np.argmin(np.abs(axis - angle)))
    if abs(axis[nearest] - angle) <= _SAME_DEG:
        return nearest, 0.0
    before = int(np.searchsorted(axis, angle)) - 1
    return before, float((angle - axis[before]) / (axis[before + 1] - axis[before]))


def _interpolated(
    values: FloatArray, cells: tuple[tuple[int, float], ...] | list[tuple[int, float]]
) -> float:
    """Return the value between the corners; equal ones give themselves exactly."""
    for before, share in cells:
        low = values[before]
        values = low + share * (values[before + 1] - low) if share else low
    return float(values)
