"""Fresnel reflectance of a smooth interface: dielectrics and metals, by polarisation.

What to use when: `unpolarised` for natural light; `polarised` for a lamp or a camera behind a
polariser; `transmittance` where 1 - F is wanted near grazing (the difference would lose digits);
`wolff_polynomial` only to compare with work that used it.

The index is that of the far side over that of the near side, n - ik with k >= 0 for an absorbing
far side (a field ~ exp(+i omega t)). With n + ik every amplitude is the complex conjugate, and
every reflectance the same.

Sources: S. K. Nayar, K. Ikeuchi, T. Kanade, "Surface Reflection: Physical and Geometrical
Perspectives", IEEE PAMI 13 (1991), equations (12), (13), (41)-(43); L. B. Wolff, S. K. Nayar,
M. Oren, "Improved Diffuse Reflection Models for Computer Vision", IJCV 30 (1998), equation (2).
Both are rearranged so that no two nearly equal numbers are subtracted: at normal incidence, at
grazing and for an index near 1 they keep all digits.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.models.validity import polar
from instrument.geometry import BoolArray, FloatArray

ComplexArray = NDArray[np.complex128]


def amplitudes(theta: ArrayLike, index: ArrayLike) -> tuple[ComplexArray, ComplexArray]:
    """Field reflection coefficients (F_para, F_perp): 1991, equations (12) and (13).

    `theta` in radians, 0 to pi/2; `index` real or complex; both broadcast. Y is the index (errata:
    not "almost zero" for a dielectric). With q = sqrt(Y^2 - sin^2 theta) the numerators are

        Y^2 cos - q = (Y^2 - 1)(Y^2 cos^2 - sin^2) / (Y^2 cos + q)      (12)
        cos - q     = (1 - Y^2) / (cos + q)                             (13)
    """
    theta, Y = polar("theta", theta), _checked(index)
    c, s, Y2_1 = np.cos(theta), np.sin(theta), (Y - 1) * (Y + 1)
    q2 = np.where(s < c, (Y - s) * (Y + s), Y2_1 + c * c)  # near the critical angle it is small
    q = np.conj(np.sqrt(np.conj(q2) + 0j))  # a real index is n - 0i
    Y2 = Y * Y
    para = Y2_1 * ((Y2 + 1) * c * c - 1) / np.square(Y2 * c + q)
    perp = -Y2_1 / np.square(c + q)
    return para, perp


def reflectances(theta: ArrayLike, index: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Energy reflectances (F'_para, F'_perp) = |F|^2: 1991, equation (41). 1 in total reflection.

    `theta` in radians, 0 to pi/2; `index` real or complex; both broadcast. To 1e-12, but for a
    ten-millionth of a radian about the critical angle: |F|^2 starts there as a square root, and
    the rounding of theta itself changes more.
    """
    para, perp = (_squared_modulus(f) for f in amplitudes(theta, index))
    total = np.isreal(index) & (np.sin(theta) > np.real(index))
    return np.where(total, 1.0, para), np.where(total, 1.0, perp)


def polarised(theta: ArrayLike, index: ArrayLike, h: ArrayLike) -> FloatArray:
    """F' = h F'_para + v F'_perp with v = 1 - h: 1991, equations (42) and (43).

    `theta` in radians, 0 to pi/2; `index` real or complex; `h` the fraction of the energy whose
    field lies in the plane of incidence; all broadcast. Raises `ValueError` for an h outside 0 to
    1.
    """
    h = np.asarray(h, dtype=np.float64)
    if not np.all((h >= 0) & (h <= 1)):
        raise ValueError(f"h = {_first_outside(h, (h >= 0) & (h <= 1)):g}; allowed: 0 to 1")
    para, perp = reflectances(theta, index)
    return h * para + (1 - h) * perp


def polarised_by_index(theta: FloatArray, n: float, h: float) -> FloatArray:
    """Derivative of `polarised` by a real index n > 1, dimensionless, of theta's shape in radians.

    From the derivatives of the amplitudes that `transmittance_with_gradients` states.
    """
    c, (para, perp) = np.cos(theta), amplitudes(theta, n)
    q = np.sqrt((n - 1) * (n + 1) + c * c)
    by_para = 2 * n * c * (2 * q * q - n * n) / (q * np.square(n * n * c + q))
    by_perp = -2 * n * c / (q * np.square(c + q))
    return np.asarray(2 * h * para.real * by_para + 2 * (1 - h) * perp.real * by_perp)


def unpolarised(theta: ArrayLike, index: ArrayLike) -> FloatArray:
    """F(theta, n) of natural light: 1998, equation (2), which is (42) with h = v = 1/2.

    `theta` in radians and `index` broadcast. Defined at theta = 0 too, where (2) as printed is 0/0
    (errata). 1 beyond the critical angle.
    """
    return polarised(theta, index, 0.5)


def transmittance(theta: ArrayLike, n: ArrayLike) -> FloatArray:
    """1 - F(theta, n) of natural light into a dielectric with real n >= 1, to full precision.

    `theta`, in radians on the outer side, and `n` broadcast. The reverse light path has the same
    transmittance: 1 - F(theta, n) = 1 - F(asin(sin(theta)/n), 1/n), both factors of 1998 (7).
    """
    n = np.asarray(n, dtype=np.float64)
    if not np.all(n >= 1):
        raise ValueError(f"n = {_first_outside(n, n >= 1):g}; allowed: 1 or more")
    return transmittance_at_cosine(np.cos(polar("theta", theta)), n)


def transmittance_at_cosine(c: FloatArray, n: FloatArray | float) -> FloatArray:
    """`transmittance` at the cosines c of 0 to 1 of theta, dimensionless; c and n broadcast."""
    n2, q = n * n, np.sqrt((n - 1) * (n + 1) + c * c)
    result: FloatArray = 2 * c * q * (1 / np.square(c + q) + n2 / np.square(n2 * c + q))
    return result


def transmittance_with_gradients(
    c: FloatArray, n: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """`transmittance_at_cosine` and its derivatives by n and by c, (N,) each, dimensionless.

    That by n grows without limit at grazing for n = 1. The function is 1 - (F_perp^2 + F_para^2)/2,
    and

        d(F_perp)/dn = -2 n c / (q (c + q)^2),   d(F_para)/dn = 2 n c (2 q^2 - n^2) / (q P)
        d(F_perp)/dc = 2 (n^2 - 1) / (q (c + q)^2),   d(F_para)/dc = 2 n^2 (n^2 - 1) / (q P)

    with q = sqrt(n^2 - sin^2 theta) and P = (n^2 c + q)^2, from dq/dn = n/q and dq/dc = c/q.
    """
    n2, n2_1 = n * n, (n - 1) * (n + 1)
    q = np.sqrt(n2_1 + c * c)
    p, P = np.square(c + q), np.square(n2 * c + q)
    perp, para = -n2_1 / (p * p), n2_1 * ((n2 + 1) * c * c - 1) / (P * P)
    transmitted = 2 * c * q * (1 / p + n2 / P)
    by_n = 2 * n * c / q * (perp - para * (2 * q * q - n2))
    by_cosine = -2 * n2_1 / q * (perp + n2 * para)
    return transmitted, by_n, by_cosine


def wolff_polynomial(theta: ArrayLike, epsilon: float = 0.07) -> FloatArray:
    """Wolff's polynomial for F: 1998, after (7): ((2 theta/pi)^5 + epsilon) / (1 + epsilon).

    `theta` in radians, any shape; `epsilon`, which stands for n, 0 or more. It is coarse: with
    0.07, against the exact F of n = 1.5, it is 0.025 too high at normal incidence (0.065 for 0.040)
    and up to 0.20 too high, at 79 degrees.
    """
    if not 0 <= epsilon < np.inf:
        raise ValueError(f"epsilon = {epsilon:g}; allowed: 0 or more")
    fifth = np.power(polar("theta", theta) * (2 / np.pi), 5)
    return np.asarray((fifth + epsilon) / (1 + epsilon), dtype=np.float64)


def _squared_modulus(f: ComplexArray) -> FloatArray:
    return np.asarray(np.minimum(np.square(f.real) + np.square(f.imag), 1.0))


def _checked(index: ArrayLike) -> NDArray[np.complex128]:
    Y = np.asarray(index, dtype=np.complex128)
    allowed = np.isfinite(Y) & (Y.real > 0)
    if not np.all(allowed):
        raise ValueError(f"index = {Y[~allowed].flat[0]}; allowed: finite, real part above 0")
    return Y


def _first_outside(values: FloatArray, allowed: BoolArray) -> float:
    return float(values[~allowed].flat[0])
