"""Outline: parameters keep their order, limits are those of chi2, fits find what was put in."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.interlocks.picture.edges import FoundEdge, outward_normal
from acquisition.interlocks.picture.outline import (
    CHI2_LIMITS,
    LIMIT_SIGMA,
    Comparison,
    Deviation,
    Estimate,
    Outline,
    Rectangle,
)
from instrument.config.load import Loaded
from instrument.pinhole import Pinhole

U = Deviation(0.02, 0.2, 0.2, 1.0, 1.0, 1.0, 0.2, 0.2, 0.2, 0.5, 0.5, 0.01, 0.3)


def _comparison(demo: Loaded, theta_r_deg: float, true: Deviation) -> Comparison:
    """Edges of a deviating surface as they would be found without any error."""
    outline = Outline(Pinhole.of(demo.rig), theta_r_deg, Rectangle(50.8, 40.0), Estimate.of(U))
    corners = outline.corners_px()
    ideal = [
        FoundEdge(k, corners[[k, (k + 1) % 4]], outward_normal(corners, k), np.zeros(2), 0.02)
        for k in range(4)
    ]
    offsets = outline.offsets_px(ideal, true).reshape(-1, 2)
    found = [
        FoundEdge(e.index, e.points_px, e.normal, offset, e.u_px)
        for e, offset in zip(ideal, offsets, strict=True)
    ]
    return Comparison(outline, found)


@pytest.mark.parametrize("theta_r_deg", [-70.0, 50.0])
def test_free_parameters_are_found(demo: Loaded, theta_r_deg: float) -> None:
    slip = _comparison(demo, theta_r_deg, Deviation(theta_r_deg=-6.0))
    assert slip.contradicts
    assert slip.with_free("theta_r_deg")[0].theta_r_deg == pytest.approx(-6.0, abs=0.05)
    size = _comparison(demo, theta_r_deg, Deviation(width_mm=-9.0, height_mm=6.0))
    at = size.with_free("width_mm", "height_mm")[0]
    assert (at.width_mm, at.height_mm) == pytest.approx((-9.0, 6.0), abs=0.3)


def test_a_picture_narrows_what_lasts_and_nothing_else(demo: Loaded) -> None:
    true = Deviation(x_mm=0.8, width_mm=0.4)
    before = _comparison(demo, 20.0, true)
    after = before.learnt()
    spread = Deviation.of(np.sqrt(np.diag(after.covariance)))
    assert (spread.theta_r_deg, spread.column_mm) == (U.theta_r_deg, U.column_mm)
    assert spread.x_mm < 0.5 * U.x_mm
    assert after.mean[:3].tolist() == [0.0, 0.0, 0.0]
    assert Deviation.of(after.mean).x_mm == pytest.approx(0.8, abs=0.2)


def test_the_limits_are_as_rare_as_six_standard_deviations() -> None:
    from scipy.stats import chi2, norm

    for values, limit in CHI2_LIMITS.items():
        assert limit == pytest.approx(chi2.isf(2 * norm.sf(LIMIT_SIGMA), values), abs=0.005)


def test_a_deviation_keeps_the_order_of_its_fields() -> None:
    values = np.arange(13.0)
    assert Deviation.of(values).values.tolist() == values.tolist()
