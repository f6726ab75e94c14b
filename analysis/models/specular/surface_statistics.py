"""Statistics of a random height field: slopes from heights, and which components are visible.

Lengths are in wavelengths: `sigma_h` is the standard deviation of the surface's height, normally
distributed, `correlation_length` the T of its autocorrelation exp(-tau^2 / T^2).

Source: S. K. Nayar, K. Ikeuchi, T. Kanade, IEEE Transactions on Pattern Analysis and Machine
Intelligence 13 (1991), sections II and IV. The authors read the thresholds off their
diagrams and stated no tolerance. `has_lobe` to `has_gaussian_lobe` are library only.
"""

from __future__ import annotations

import math

SPIKE_ONLY = 0.025  # sigma_h in wavelengths: below it, a mirror (section IV-A-1, after Fig. 9)
NO_SPIKE = 1.5  # sigma_h in wavelengths: above it, no spike away from grazing (the same)
SPIKE_LIKE_LOBE = 0.02  # sigma_h / T: below it, the lobe looks like a spike (Fig. 10b)
GAUSSIAN_LOBE = 0.05  # sigma_h / T: below it, the lobe is a Gaussian on the mirror direction


def slope_sigma_deg(sigma_h: float, correlation_length: float) -> float:
    """sigma_alpha in degrees of the equivalent Gaussian slopes: 1991, equation (60).

    sigma_alpha = atan(2 sigma_h / T) / sqrt(2). It replaces alpha by tan(alpha), so it is good for
    gentle slopes; at 1/e of their peaks the two lobes agree at any roughness.
    """
    return math.degrees(math.atan(slope_scale(sigma_h, correlation_length))) / math.sqrt(2)


def height_over_length(sigma_deg: float) -> float:
    """sigma_h / T of the surface with slopes of standard deviation `sigma_deg`: inverse of (60).

    Raises `ValueError` outside 0 to 90 / sqrt(2) = 63.6 degrees, where (60) ends.
    """
    if not 0 <= sigma_deg < 90 / math.sqrt(2):
        raise ValueError(f"sigma_deg = {sigma_deg:g} degrees; allowed: 0 to below 63.6 degrees")
    return math.tan(math.sqrt(2) * math.radians(sigma_deg)) / 2


def slope_scale(sigma_h: float, correlation_length: float) -> float:
    """tan(alpha_0) = 2 sigma_h / T, where the lobe of a rough surface is 1/e: 1991, (58)."""
    check_lengths(sigma_h, correlation_length)
    return 2 * sigma_h / correlation_length


def has_lobe(sigma_h: float) -> bool:
    """Return True if the lobe is visible: sigma_h of 0.025 wavelengths or more."""
    check_lengths(sigma_h)
    return sigma_h >= SPIKE_ONLY


def has_spike(sigma_h: float) -> bool:
    """Return True if the spike is visible away from grazing: sigma_h up to 1.5 wavelengths."""
    check_lengths(sigma_h)
    return sigma_h <= NO_SPIKE


def has_spike_like_lobe(sigma_h: float, correlation_length: float) -> bool:
    """Return True if the lobe itself looks like a spike: sigma_h / T below 0.02."""
    check_lengths(sigma_h, correlation_length)
    return sigma_h / correlation_length < SPIKE_LIKE_LOBE


def has_gaussian_lobe(sigma_h: float, correlation_length: float) -> bool:
    """Return True if the lobe is a Gaussian about the mirror direction: sigma_h / T below 0.05.

    Rougher surfaces have their peak beyond the mirror direction.
    """
    check_lengths(sigma_h, correlation_length)
    return sigma_h / correlation_length < GAUSSIAN_LOBE


def curvature_radius(sigma_h: float, correlation_length: float) -> float:
    """Typical radius of curvature in wavelengths, infinite for a plane: T^2 / (2 sqrt(3) sigma_h).

    The inverse of the standard deviation of the second derivative of a height with the
    autocorrelation exp(-tau^2 / T^2), which is sqrt(12) sigma_h / T^2. Kirchhoff's assumption
    (section III-A-2) needs it to be larger than the wavelength.
    """
    check_lengths(sigma_h, correlation_length)
    if sigma_h == 0:
        return math.inf
    return correlation_length**2 / (2 * math.sqrt(3) * sigma_h)


def unshadowed_deg(sigma_h: float, correlation_length: float) -> float:
    """Largest angle from the normal, in degrees, with negligible shadowing: 90 - alpha_0.

    There cot(theta) = tan(alpha_0) = 2 sigma_h / T, and Smith's shadowing of a Gaussian surface
    (IEEE Transactions on Antennas and Propagation 15, 1967) is
    Λ = (e^-1 / sqrt(pi) - erfc(1)) / 2 = 0.025: 2.5 % of the facets are hidden.
    """
    return 90 - math.degrees(math.atan(slope_scale(sigma_h, correlation_length)))


def check_lengths(sigma_h: float, correlation_length: float = 1.0) -> None:
    """Raise `ValueError` for a height below 0 or a length of 0 or less (wavelengths)."""
    if not 0 <= sigma_h < math.inf:
        raise ValueError(f"sigma_h = {sigma_h:g} wavelengths; allowed: 0 or more")
    if not 0 < correlation_length < math.inf:
        raise ValueError(
            f"correlation_length = {correlation_length:g} wavelengths; allowed: more than 0"
        )
