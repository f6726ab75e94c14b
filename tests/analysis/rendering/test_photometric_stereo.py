"""Photometric stereo costs with Lambert's law what the paper's vase shows, and little without."""

import numpy as np
import pytest

from analysis.rendering import photometric_stereo
from analysis.rendering.material import Material
from analysis.rendering.photometric_stereo import Recovered, three_lamps, two_lamps
from analysis.rendering.shapes import sphere, vase

LAMBERT = Material.named("lambert", albedo=0.7)


def rough(sigma_deg: float) -> Material:
    return Material.named("oren_nayar_exact", albedo=0.7, sigma_deg=sigma_deg)


@pytest.mark.parametrize(
    ("sigma_deg", "off_deg", "depth"),
    [(10, 1.6, 0.93), (20, 4.1, 0.83), (30, 6.3, 0.75), (40, 8.1, 0.69)],
)
def test_lambert_flattens_a_rough_cylinder(sigma_deg: float, off_deg: float, depth: float) -> None:
    """Two lamps at 10 degrees, as 1995, Figures 26 and 27; measured with normals up to 70 degrees.

    The paper prints no number, but that Lambert's errors are large and the own model's are not.
    """
    found = two_lamps(rough(sigma_deg))
    assert found.by_lambert.normals_off_deg == pytest.approx(off_deg, abs=0.05)
    assert found.by_lambert.depth == pytest.approx(depth, abs=0.005)
    assert found.by_model.normals_off_deg < 0.02
    noisy = two_lamps(rough(sigma_deg), noise=0.005).by_model
    assert noisy.normals_off_deg < 1.6
    assert noisy.depth == pytest.approx(1, abs=0.01)


def test_a_lambertian_cylinder_costs_nothing_and_noise_as_photons_say() -> None:
    """Of the angle: cos^2(angle) / tan(10 deg) / sqrt(2) times the relative u of a brightness.

    In the mean over angles; a brightness has the u of the brightest over sqrt(cos(angle)).
    """
    assert two_lamps(LAMBERT).by_lambert.normals_off_deg < 0.01
    noise, angle = 0.002, np.radians(np.arange(-70, 71))
    each = noise / np.sqrt(np.cos(angle)) * np.cos(angle) ** 2 / np.tan(np.radians(10)) / 2**0.5
    expected = np.degrees(np.sqrt(np.mean(each**2)))
    found = two_lamps(LAMBERT, noise=noise)
    for one in (found.by_lambert, found.by_model):
        assert one.normals_off_deg == pytest.approx(expected, rel=0.15)


def test_the_own_model_resolves_a_highlight() -> None:
    glossy = Material.named("oren_nayar+torrance_sparrow", albedo=0.7, sigma_deg=20.0, ks=0.3)
    found = two_lamps(glossy, noise=0.003)
    assert found.by_lambert.normals_off_deg > 3
    assert found.by_model.normals_off_deg < 1


@pytest.fixture
def _coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(photometric_stereo, "_SPIRAL", 5000)


@pytest.mark.usefixtures("_coarse")
def test_three_lamps_recover_a_whole_vase() -> None:
    found = three_lamps(rough(30), vase(40))
    assert found.by_lambert.normals_off_deg > 6
    assert 0.7 < found.by_lambert.depth < 0.8
    assert found.by_model.normals_off_deg < 1.4  # the table's step
    assert found.by_model.depth == pytest.approx(1, abs=0.02)
    assert "3 lamps" in found.sentence()


@pytest.mark.usefixtures("_coarse")
def test_three_lamps_see_a_lambertian_sphere_as_it_is() -> None:
    surface = sphere(40)
    found = three_lamps(LAMBERT, surface)
    assert found.by_lambert.normals_off_deg < 1e-6
    assert found.by_lambert.depth == pytest.approx(1)
    across = np.sqrt(1 - found.places**2 - surface.y[20] ** 2)
    steps = np.abs(found.heights - (across - across[0]))
    assert np.max(steps) < 0.03  # by the trapezoidal rule, on 40 pixels


def test_noise_counts_once_and_the_same_noise_gives_the_same_numbers() -> None:
    one, other = (two_lamps(rough(20), noise=0.01).by_lambert for _ in range(2))
    assert isinstance(one, Recovered)
    assert one.normals_off_deg == other.normals_off_deg
    assert np.array_equal(one.heights, other.heights)
