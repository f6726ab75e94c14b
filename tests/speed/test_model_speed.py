"""Speed of the printed forms and of Beckmann's sum; the timed values are checked.

Limits are ratios within one run: a formula's time per geometry over that of a ruler, sin(x) +
cos(x) of as many angles. The ruler is vectorised differently on each processor, so the limits have
a margin: the qualitative form took 1.7 rulers on an Intel core with AVX-512 and 1.9 to 2.2 on an
AMD one without, the functional form 3.4 and 3.7.
"""

from __future__ import annotations

import math
import time

import mpmath as mp
import numpy as np
import pytest

from analysis.models import MODELS
from instrument.geometry import FloatArray, Geometry
from tests.support.models.printed_forms import printed_functional, printed_qualitative

SIZE = 1 << 18


def geometries() -> Geometry:
    random = np.random.default_rng(3)
    return Geometry.from_degrees(
        theta_i=random.uniform(0, 85, SIZE),
        theta_r=random.uniform(0, 85, SIZE),
        dphi=random.uniform(0, 360, SIZE),
    )


def in_rulers(name: str, geometry: Geometry) -> tuple[float, FloatArray]:
    """Least CPU time over the ruler's, taken in turns, and the BRDF found."""
    model, angles = MODELS[name], geometry.theta_i
    ruler, formula = [], []
    for _ in range(20):
        start = time.process_time()
        np.sin(angles) + np.cos(angles)
        middle = time.process_time()
        found = model.brdf(geometry, albedo=0.8, sigma_deg=30.0)
        ruler.append(middle - start)
        formula.append(time.process_time() - middle)
    return min(formula) / min(ruler), found


PRINTED = {"oren_nayar": printed_functional, "oren_nayar_qualitative": printed_qualitative}


@pytest.mark.parametrize(("name", "limit"), [("oren_nayar_qualitative", 3.0), ("oren_nayar", 6.0)])
def test_the_printed_forms_are_fast(name: str, limit: float) -> None:
    geometry = geometries()
    rulers, found = in_rulers(name, geometry)
    for k in range(0, SIZE, SIZE // 50):
        angles = (a[k] for a in (geometry.theta_i, geometry.theta_r, np.radians(geometry.dphi_deg)))
        expected = PRINTED[name](*angles, 0.8, math.radians(30.0))
        assert found[k] == pytest.approx(expected, rel=1e-12, abs=1e-14)
    assert rulers <= limit


def beckmann(sigma_h: float) -> tuple[float, FloatArray]:
    """CPU time of an evaluation in the mirror direction, and the BRDF."""
    geometry = Geometry.from_degrees(theta_i=np.zeros(40_000), theta_r=0.0, dphi=180.0)
    start = time.process_time()
    found = MODELS["beckmann_spizzichino"].brdf(
        geometry, scale=1.0, sigma_h=sigma_h, correlation_length=10.0
    )
    return time.process_time() - start, found


def test_the_cost_of_the_beckmann_sum_does_not_grow_with_g() -> None:
    """At g = 1e6 no more than twice that at g = 10, least of 20 each in turns."""
    least: dict[float, float] = {10.0: math.inf, 1e6: math.inf}
    for _ in range(20):
        for g, so_far in tuple(least.items()):
            seconds, found = beckmann(math.sqrt(g) / (4 * math.pi))
            least[g] = min(so_far, seconds)
            with mp.workdps(50):  # q = 0: the sum in closed form
                total = float(mp.exp(-g) * (mp.ei(g) - mp.euler - mp.log(g)))
            np.testing.assert_allclose(found, math.pi * 100.0 * total, rtol=1e-9)
    assert least[1e6] <= 2 * least[10.0]
