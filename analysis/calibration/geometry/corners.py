"""Corners of a board as found in pictures at several view angles, in two places of the board."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from instrument.geometry import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Corners:
    """Corners of a board: a row of each found in a picture.

    board_mm (m, 2): all corners of the board. number (n,): of the corner on the board. pixels
    (n, 2): column first. picture (n,): its number. theta_r_deg (pictures,): as the axis shows it.
    turned (pictures,): True if the board was turned by half a turn.
    """

    board_mm: FloatArray
    number: IntArray
    pixels: FloatArray
    picture: IntArray
    theta_r_deg: FloatArray
    turned: BoolArray

    @property
    def pictures(self) -> int:
        """Number of pictures."""
        return self.theta_r_deg.size

    @property
    def angles(self) -> tuple[FloatArray, IntArray]:
        """Distinct view angles (k,) in degrees, and the number of each picture's (pictures,)."""
        angles, number = np.unique(self.theta_r_deg, return_inverse=True)
        return angles, np.asarray(number)

    def only(self, used: BoolArray) -> Corners:
        """Return the corners for which the mask `used` (n,) is True."""
        return replace(
            self,
            number=self.number[used],
            pixels=self.pixels[used],
            picture=self.picture[used],
        )
