"""Brightness across a cylinder: flat for rough clay, as the papers found, not by Lambert's law."""

from functools import partial

import numpy as np
import pytest

from analysis.models import MODELS
from analysis.rendering.cross_section import across
from analysis.rendering.light import HEADLIGHT, light
from analysis.rendering.material import Material
from analysis.rendering.render import render
from analysis.rendering.shapes import cylinder, vase

LAMBERT = Material.named("lambert", albedo=0.7)
CLAY = Material.named("oren_nayar_exact", albedo=0.7, sigma_deg=40.0)
"""The clay vase of Oren and Nayar 1995, Figure 23."""
ROUGH = partial(MODELS["oren_nayar"].brdf, albedo=0.7, sigma_deg=40.0)


def test_the_clay_vase_is_flat_where_lamberts_is_not() -> None:
    """1995, Figure 24(a): nearly constant over most of the cross-section, with sigma = 40 degrees.

    .85 of the middle at 60 degrees, where Lambert's law has cos 60 = .50.
    """
    middle, aside = across(CLAY, [HEADLIGHT], np.array([0.0, 60.0]))
    assert aside / middle == pytest.approx(0.85, abs=0.005)
    middle, aside = across(LAMBERT, [HEADLIGHT], np.array([0.0, 60.0]))
    assert aside / middle == pytest.approx(0.5)


def test_a_lamp_20_degrees_aside_moves_the_peak_of_lambert_only_that_far() -> None:
    """1995, Figure 24(b): the peak of Lambert's vase is far from that of the rough one."""
    angles = np.arange(-89.0, 90.0)
    peak = {m.name: angles[np.argmax(across(m, [light(20)], angles))] for m in (LAMBERT, CLAY)}
    assert peak["lambert"] == 20
    assert peak["oren_nayar_exact"] > 35


@pytest.mark.parametrize(("size", "tilt"), [(120, 0.0), (121, 0.0)])
def test_the_body_of_the_vase_is_the_cross_section_of_a_cylinder(size: int, tilt: float) -> None:
    lamps = [light(20), HEADLIGHT]
    for surface in (vase(size), cylinder(size, tilt)):
        row = render(surface, ROUGH, lamps)[size // 2]
        seen = np.isfinite(row)
        angles = np.degrees(np.arcsin(surface.x[seen]))
        assert row[seen] == pytest.approx(across(ROUGH, lamps, angles), rel=1e-9)
