"""Reflectance maps: as plane as the moon's for a rough surface, and not by Lambert's law."""

import math

import numpy as np
import pytest

from analysis.rendering.light import HEADLIGHT, light
from analysis.rendering.material import Material
from analysis.rendering.reflectance_map import reflectance_map
from instrument.geometry import FloatArray, Geometry


def test_reflectance_maps_become_plane_with_roughness() -> None:
    """1995, Figure 25: sigma = 60 degrees is like the moon's linear map, Lambert's is not."""
    lamp = [light(10, 45)]
    rough = Material.named("oren_nayar_exact", albedo=0.9, sigma_deg=60.0)
    flat = Material.named("lambert", albedo=0.9)
    assert reflectance_map(rough, lamp, size=41).plane_r2 == pytest.approx(0.82, abs=0.005)
    assert reflectance_map(flat, lamp, size=41).plane_r2 == pytest.approx(0.33, abs=0.005)


def test_a_plane_map_has_r2_of_1_and_an_even_one_none() -> None:
    def linear(geometry: Geometry) -> FloatArray:  # Horn's moon: sqrt(cos i / cos r), squared
        return 1 / np.cos(geometry.theta_r)

    def even(geometry: Geometry) -> FloatArray:
        return 1 / np.cos(geometry.theta_i)

    assert reflectance_map(linear, [light(10, 30)], size=21).plane_r2 == pytest.approx(1)
    assert math.isnan(reflectance_map(even, [HEADLIGHT], size=21).plane_r2)
