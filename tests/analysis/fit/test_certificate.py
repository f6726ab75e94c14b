"""Scale by the certificate or by the model's form: what each says, and which one leads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from analysis.choice.choice import choose
from analysis.choice.notes import NoteCode
from analysis.data.measurements import Measurements, SharedError
from analysis.fit.certificate import CERTIFICATE, certificate_u, led_by_certificate, told_by
from analysis.fit.fit import FitResult, fit
from analysis.models import MODELS
from tests.support.analysis.seeded_scan import scan

ROUGH = {"albedo": 0.8, "sigma_deg": 30.0}
U_TILE = 0.01


def precise(name: str, seed: int, noise: float, truth: Mapping[str, float]) -> Measurements:
    """A scan with that relative noise, and angles to 0.005 deg or less."""
    u_deg = min(0.005, 50 * noise)
    return scan(name, seed, u_tile=0.0, u_relative=noise, u_deg=u_deg, acceptance=None, **truth)


def certified(name: str, seed: int, off_u: float = 0.0, **truth: float) -> Measurements:
    """A precise scan whose tile has a certificate with a u of 1 %, and is off by `off_u` of it."""
    m = precise(name, seed, 2e-4, truth)
    tile = SharedError.common_to_all(CERTIFICATE, U_TILE, m.size)
    brdf = m.brdf * (1 + off_u * U_TILE)
    return replace(m, brdf=brdf, shared=(tile,))


def u_of(result: FitResult | None, name: str) -> float:
    u = None if result is None else result.u[name]
    assert u is not None
    return u


def test_a_matt_sample_tells_nothing_about_the_certificate() -> None:
    m = certified("lambert", 1, albedo=0.6)
    found = fit(MODELS["lambert"], m)
    assert told_by(found, m).u == pytest.approx(1.0, abs=1e-3)
    led = led_by_certificate(found, m)
    assert led.values["albedo"] == pytest.approx(found.values["albedo"], rel=1e-3)
    assert u_of(led, "albedo") == pytest.approx(u_of(found, "albedo"), rel=0.02)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("off_u", [-1.5, 2.0])
def test_the_form_of_a_rough_surface_tells_the_error_of_the_certificate(
    seed: int, off_u: float
) -> None:
    m = certified("oren_nayar", seed, off_u, **ROUGH)
    found = fit(MODELS["oren_nayar"], m)
    told = told_by(found, m)
    assert told.u < 0.5
    assert abs(told.pull - off_u) < 4 * told.u
    assert u_of(found, "albedo") < 0.5 * U_TILE * 0.8


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("off_u", [-1.5, 0.0, 2.0])
def test_where_the_certificate_leads_no_form_corrects_the_scale(seed: int, off_u: float) -> None:
    """The albedo is off as the certificate is, and its u is at least the certificate's."""
    m = certified("oren_nayar", seed, off_u, **ROUGH)
    found = fit(MODELS["oren_nayar"], m)
    led = led_by_certificate(found, m)
    assert led.values["albedo"] / 0.8 - 1 == pytest.approx(off_u * U_TILE, abs=0.35 * U_TILE)
    assert 0.7 * U_TILE < u_of(led, "albedo") / 0.8 < 1.3 * U_TILE
    pull = (led.values["sigma_deg"] - ROUGH["sigma_deg"]) / u_of(led, "sigma_deg")
    assert abs(pull) < max(3.5, 1.5 * abs(off_u))
    assert led.chi2 == found.chi2


@pytest.mark.slow
def test_the_u_of_a_led_fit_is_the_spread_over_certificates(slow: bool) -> None:
    """Over drawn errors of the certificate and of the values."""
    random, values, stated = np.random.default_rng(18), [], []
    for seed in range(400 if slow else 20):
        m = certified("oren_nayar", seed, float(random.standard_normal()), **ROUGH)
        led = led_by_certificate(fit(MODELS["oren_nayar"], m), m)
        values.append(list(led.values.values()))
        stated.append([u_of(led, name) for name in ROUGH])
    spread = np.std(np.array(values) - [0.8, 30.0], axis=0)
    np.testing.assert_allclose(spread, np.mean(stated, axis=0), rtol=0.12 if slow else 0.5)


def test_a_choice_says_which_one_leads() -> None:
    m = certified("oren_nayar", 5, 2.0, **ROUGH)
    by_form, by_certificate = (
        choose(m, models=["lambert", "oren_nayar"], certificate_leads=leads)
        for leads in (False, True)
    )
    assert by_form.chosen == by_certificate.chosen == "oren_nayar"
    assert by_form.verdict == by_certificate.verdict == "adequate"
    first, second = (
        next(n.text for n in choice.notes if n.code == NoteCode.SCALE_BY_FORM)
        for choice in (by_form, by_certificate)
    )
    assert first.startswith("the form of oren_nayar tells the error that all values have from the")
    assert "where the certificate has 1 %; the form leads" in first
    assert first.endswith("fit: scale: certificate in the protocol lets the certificate lead")
    assert second.endswith("the certificate leads all the same, by fit: scale in the protocol")
    assert u_of(by_certificate.best, "albedo") > 2 * u_of(by_form.best, "albedo")
    plain = choose(certified("lambert", 2, albedo=0.6), models=["lambert", "oren_nayar"])
    assert not [n for n in plain.notes if n.code == NoteCode.SCALE_BY_FORM]


def test_only_the_error_that_all_values_share_is_a_scale() -> None:
    m = certified("lambert", 1, albedo=0.6)
    own = SharedError(CERTIFICATE, np.full(m.size, 0.02), m.lamp_setting)
    other = SharedError.common_to_all("sample placement", 0.02, m.size)
    assert certificate_u(replace(m, shared=(*m.shared, own, other))) == pytest.approx(U_TILE)
    assert certificate_u(replace(m, shared=(own, other))) == 0.0
    found = fit(MODELS["lambert"], replace(m, shared=(own,)))
    assert led_by_certificate(found, replace(m, shared=(own,))) is found


@pytest.mark.parametrize("errors", [(0.05, -0.04, -0.04), (-0.043, 0.0, 0.026)])
def test_errors_of_several_per_cent_that_sweeps_do_not_share_hide_no_model(
    errors: tuple[float, float, float],
) -> None:
    """One number for a tile that departs from it at each incidence: the right model is adequate."""
    truth = {"albedo": 0.8, "sigma_deg": 20.0, "ks": 0.08}
    m = precise("oren_nayar+torrance_sparrow", 3, 2e-5, truth)
    own = SharedError(CERTIFICATE, np.full(m.size, 0.05), m.lamp_setting)
    factor = 1 + np.array(errors)[m.lamp_setting]
    off = replace(m, brdf=m.brdf * factor, shared=(own,))
    found = fit(MODELS["oren_nayar+torrance_sparrow"], off)
    assert found.reduced_chi2 is not None
    assert found.reduced_chi2 < 1.6
    assert found.values["sigma_deg"] == pytest.approx(20.0, abs=0.3)
