"""Response curve of a camera, as its inverse: from counts to light.

Counts and light are shares of full scale: 0 at black and 1 at the largest count.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from instrument.geometry import FloatArray

POLYNOMIAL, GAMMA, SRGB, BT709 = "polynomial", "gamma", "sRGB", "ITU-R BT.709"
_STEP = 1e-4  # of full scale: of the differences that give gradients


@dataclass(frozen=True, slots=True)
class ResponseCurve:
    """Inverse response by its kind and parameters.

    polynomial: light = s (1 + (1 - s) (c0 + c1 s + ...)) of the counts s; without parameters they
    are proportional. gamma: light = s**gamma. sRGB and ITU-R BT.709 have no parameters.
    """

    kind: str = POLYNOMIAL
    parameters: tuple[float, ...] = ()

    @property
    def is_video(self) -> bool:
        """True for a curve that is made for a screen: a gamma was left on."""
        return self.kind != POLYNOMIAL

    @property
    def name(self) -> str:
        """Name of the curve for a person."""
        if self.kind == GAMMA:
            return f"gamma {self.parameters[0]:.3g}"
        if self.is_video:
            return f"{self.kind} curve"
        return "residual non-linearity" if self.parameters else "proportional"

    def light(self, share: FloatArray) -> FloatArray:
        """Return the light of counts, both shares of full scale (dimensionless), of any shape."""
        return _KINDS[self.kind](np.asarray(share, dtype=np.float64), self.parameters)

    def gradient(self, share: FloatArray) -> FloatArray:
        """Return d(light)/d(counts), dimensionless, at shares of full scale of any shape."""
        return (self.light(share + _STEP) - self.light(share - _STEP)) / (2 * _STEP)

    def curvature(self, share: FloatArray) -> FloatArray:
        """Return the second derivative, dimensionless, at shares of full scale of any shape."""
        around = self.light(share + _STEP) + self.light(share - _STEP)
        return (around - 2 * self.light(share)) / _STEP**2


def _polynomial(share: FloatArray, parameters: tuple[float, ...]) -> FloatArray:
    factor = np.polynomial.polynomial.polyval(share, parameters or (0.0,))
    return np.asarray(share * (1 + (1 - share) * factor), dtype=np.float64)


def _gamma(share: FloatArray, parameters: tuple[float, ...]) -> FloatArray:
    """Odd below black, where only noise leads."""
    return np.asarray(np.sign(share) * np.abs(share) ** parameters[0], dtype=np.float64)


def _srgb(share: FloatArray, _: tuple[float, ...]) -> FloatArray:
    """IEC 61966-2-1:1999, 5.2: from encoded to linear."""
    above = ((np.maximum(share, 0.0) + 0.055) / 1.055) ** 2.4
    return np.where(share <= 0.04045, share / 12.92, above)


def _bt709(share: FloatArray, _: tuple[float, ...]) -> FloatArray:
    """Rec. ITU-R BT.709-6, item 1.2, inverted."""
    above = ((np.maximum(share, 0.0) + 0.099) / 1.099) ** (1 / 0.45)
    return np.where(share < 0.081, share / 4.5, above)


_KINDS: dict[str, Callable[[FloatArray, tuple[float, ...]], FloatArray]] = {
    POLYNOMIAL: _polynomial,
    GAMMA: _gamma,
    SRGB: _srgb,
    BT709: _bt709,
}
