"""Pictures of a fitted material: of which models, and by which noise."""

from types import SimpleNamespace

import numpy as np
import pytest

from acquisition.results.facts.rendered_material import pixel_noise, rendered_material
from analysis.models import MODELS
from instrument.config.load import load_protocol
from tests.support.paths import CONFIGS


def fitted(name, **values):
    own = {p.name: p.default for p in MODELS[name].parameters}
    return SimpleNamespace(model=name, values={**own, "per_brdf": 3.0, **values})


def test_the_pictures_are_those_of_the_model_and_of_lambert() -> None:
    found = rendered_material(fitted("oren_nayar", albedo=0.6, sigma_deg=30.0), 0.003)()
    assert found.albedo == 0.6
    assert np.nanmax(found.lambert) == pytest.approx(0.6 / np.pi, rel=1e-3)
    assert np.nanpercentile(found.lambert, 5) < np.nanpercentile(found.model, 5)
    assert "0.3 % (one pixel of this camera" in found.cost
    assert np.ptp(found.lambert_heights) < np.ptp(found.heights)
    assert np.ptp(found.model_heights) == pytest.approx(np.ptp(found.heights), rel=0.03)


@pytest.mark.parametrize("name", MODELS)
def test_every_model_can_be_shown(name: str) -> None:
    make = rendered_material(fitted(name), None)
    assert (make is None) == (name == "lambert")
    if make is not None:
        found = make()
        assert np.all(np.isfinite(found.lambert_heights))
        assert "assumed" in found.cost


def test_nothing_is_shown_of_nothing() -> None:
    assert rendered_material(None, 0.01) is None
    assert rendered_material(fitted("oren_nayar", albedo=0.0), 0.01)() is None


def test_the_noise_of_a_pixel_is_that_of_photons_and_falls_with_frames() -> None:
    camera = load_protocol(CONFIGS / "protocols" / "demo.yaml").rig.camera
    one, four = (pixel_noise(camera, 0.7, frames) for frames in (1, 4))
    assert one == 2 * four
    photons = (0.7 * camera.full_well_electrons) ** -0.5
    assert photons < one < 1.2 * photons
