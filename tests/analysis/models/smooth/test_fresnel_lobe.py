"""Lobe that reflects by Fresnel, with and without a polariser: weights, names, plane, index."""

from __future__ import annotations

import math

import numpy as np
import pytest

from analysis.data.measurements import Measurements
from analysis.fit.fit import fit
from analysis.models import MODELS
from analysis.models.smooth.fresnel import polarised
from analysis.models.smooth.fresnel_lobe import out_of_plane
from analysis.models.specular.torrance_sparrow import torrance_sparrow_full
from instrument.geometry import Geometry
from tests.support.models.derivatives import central_difference


@pytest.mark.parametrize("seed", range(5))
def test_a_polariser_weights_fresnel_by_the_square_of_its_cosine(seed: int) -> None:
    """(42) with h = cos^2 A, in the plane, where the mirroring facets lie; the mean is natural."""
    random = np.random.default_rng(seed)
    index, sigma_deg = float(random.uniform(1.05, 4.0)), float(random.uniform(2.0, 40.0))
    angle_deg = round(float(random.uniform(0.0, 90.0)), 3)
    g = Geometry.from_degrees(
        theta_i=random.uniform(0, 85, 30), theta_r=random.uniform(-85, 85, 30)
    )
    values = {"index": index, "lobe_sigma_deg": sigma_deg}
    h = math.cos(math.radians(angle_deg)) ** 2
    expected = torrance_sparrow_full(g, lambda t: polarised(t, index, h), sigma_deg)
    through = MODELS[f"fresnel_lobe@{angle_deg}"]
    np.testing.assert_allclose(through.brdf(g, **values), expected, rtol=1e-12)
    across = MODELS["fresnel_lobe@0"].brdf(g, **values) + MODELS["fresnel_lobe@90"].brdf(
        g, **values
    )
    np.testing.assert_allclose(across / 2, MODELS["fresnel_lobe"].brdf(g, **values), rtol=1e-12)
    for name, value in values.items():
        numeric = central_difference(
            lambda x, n=name: through.brdf(g, **{**values, n: x}), value, 1e-3
        )
        exact = through.gradient(g, **values)[name]
        np.testing.assert_allclose(exact, numeric, rtol=1e-6, atol=1e-7 * np.max(np.abs(exact)))


def test_the_lobe_vanishes_at_the_brewster_angle_in_the_plane() -> None:
    brewster_deg = math.degrees(math.atan(1.5))
    g = Geometry.from_degrees(theta_i=brewster_deg, theta_r=brewster_deg, dphi=180.0)
    values = {"index": 1.5, "lobe_sigma_deg": 8.0}
    natural = MODELS["fresnel_lobe"].brdf(g, **values)
    assert MODELS["fresnel_lobe@0"].brdf(g, **values) < 1e-20 * natural
    assert MODELS["fresnel_lobe@90"].brdf(g, **values) == pytest.approx(2 * natural)


@pytest.mark.parametrize("name", ["fresnel_lobe@", "fresnel_lobe@91", "fresnel_lobe@-1",
                                  "fresnel_lobe@nan", "fresnel_lobe@x", "ggx@30"])  # fmt: skip
def test_an_angle_that_is_none_or_of_another_model_is_refused(name: str) -> None:
    with pytest.raises(KeyError, match="unknown model"):
        MODELS[f"lambert+{name}"]


def test_out_of_plane_the_angle_has_no_meaning() -> None:
    g = Geometry.from_degrees(theta_i=[40, 40, 40, 0.0], theta_r=[30, 30, 30, 30],
                              dphi=[0, 180, 90, 90])  # fmt: skip
    values = {"index": 1.5, "lobe_sigma_deg": 8.0}
    through = MODELS["fresnel_lobe@30"].validity(g, **values)
    assert through.mask.tolist() == [True, True, False, True]
    assert "in one plane" in through.reason
    assert MODELS["fresnel_lobe"].validity(g, **values).mask.all()
    refused = out_of_plane(["lambert", "lambert+fresnel_lobe@30"], g)
    assert refused is not None
    assert refused.startswith("lambert+fresnel_lobe@30: 1 of 4 points lie")
    assert out_of_plane(["lambert+fresnel_lobe"], g) is None


@pytest.mark.parametrize("angle", ["", "@0", "@30", "@90"])
def test_a_fit_finds_the_index_within_its_u(angle: str) -> None:
    random = np.random.default_rng(len(angle) + ord(angle[-1:] or "-"))
    model = MODELS[f"lambert+fresnel_lobe{angle}"]
    truth = {"albedo": 0.4, "index": float(random.uniform(1.3, 2.0)), "lobe_sigma_deg": 9.0}
    i, r = (a.ravel() for a in np.meshgrid([30.0, 60.0], np.arange(-75.0, 76.0, 5.0)))
    exact = model.brdf(Geometry.from_degrees(theta_i=i, theta_r=r), **truth)
    found = fit(
        model,
        Measurements(
            theta_i_deg=i, theta_r_deg=r, dphi_deg=np.zeros(i.size),
            brdf=exact * (1 + 0.005 * random.standard_normal(i.size)), u_random=0.005 * exact,
            lamp_setting=np.zeros(i.size, dtype=np.int64),
        ),
    )  # fmt: skip
    for name, value in truth.items():
        u = found.u[name]
        assert u is not None
        assert abs(found.values[name] - value) < 4 * u, name
