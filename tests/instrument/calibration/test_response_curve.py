"""Response curves: ends of the scale, gradients, and the printed values of the standards."""

from __future__ import annotations

import numpy as np
import pytest

from instrument.calibration.response_curve import BT709, GAMMA, POLYNOMIAL, SRGB, ResponseCurve

CURVES = [
    ResponseCurve(),
    ResponseCurve(POLYNOMIAL, (-0.01, 0.02, 0.005)),
    ResponseCurve(GAMMA, (2.2,)),
    ResponseCurve(SRGB),
    ResponseCurve(BT709),
]


@pytest.mark.parametrize("curve", CURVES, ids=lambda c: c.name)
def test_black_is_0_full_scale_is_1_and_light_rises(curve: ResponseCurve) -> None:
    share = np.linspace(0.0, 1.0, 501)
    light = curve.light(share)
    assert light[0] == pytest.approx(0.0, abs=1e-12)
    assert light[-1] == pytest.approx(1.0, abs=1e-12)
    assert np.all(np.diff(light) > 0)


@pytest.mark.parametrize("curve", CURVES, ids=lambda c: c.name)
def test_gradient_and_curvature_are_those_of_the_curve(curve: ResponseCurve) -> None:
    share = np.linspace(0.15, 0.95, 9)
    step = 1e-3
    rise = (curve.light(share + step) - curve.light(share - step)) / (2 * step)
    assert curve.gradient(share) == pytest.approx(rise, rel=1e-4)
    bend = (curve.gradient(share + step) - curve.gradient(share - step)) / (2 * step)
    assert curve.curvature(share) == pytest.approx(bend, rel=1e-3, abs=1e-5)


def test_values_that_follow_from_the_standards() -> None:
    """IEC 61966-2-1: 0.5 is light 0.21404; BT.709: light 0.018 is 0.081, and 0.5 is 0.7055."""
    srgb, video = ResponseCurve(SRGB), ResponseCurve(BT709)
    assert float(srgb.light(np.array(0.5))) == pytest.approx(0.21404, abs=1e-5)
    assert float(srgb.light(np.array(0.0404))) == pytest.approx(0.0404 / 12.92)
    assert float(video.light(np.array(0.0809))) == pytest.approx(0.018, rel=2e-3)
    encoded = 1.099 * 0.5**0.45 - 0.099
    assert float(video.light(np.array(encoded))) == pytest.approx(0.5)


def test_noise_below_black_stays_noise() -> None:
    share = np.array([-0.02, -0.01, 0.0])
    for curve in CURVES:
        assert np.all(np.isfinite(curve.light(share)))
        assert np.all(curve.light(share) <= 0)
