"""Fits of one model: truths come back with the stated uncertainty, and nothing more is claimed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from analysis.data.curet import read_curet
from analysis.data.measurements import Measurements, SharedError
from analysis.fit.fit import fit, stated_u
from analysis.models import MODELS
from analysis.models.special_cases import special_cases
from tests.support.analysis.random_fits import Case, random_case
from tests.support.analysis.seeded_scan import GLOSSY, RIG, scan
from tests.support.paths import ROOT


def tile_of(m: Measurements, u_relative: float) -> SharedError:
    return SharedError.common_to_all("white tile", u_relative, m.size)


def test_a_wrong_tile_reading_is_named_and_leaves_no_pattern() -> None:
    m = scan("oren_nayar", 1, albedo=0.8, sigma_deg=30)
    reading = SharedError("reading", np.full(m.size, 0.002), m.lamp_setting)
    m = replace(m, shared=(*m.shared, reading))
    off = np.where(reading.group == 1, 1.01, 1.0)  # five times the u of one tile reading
    found = fit(MODELS["oren_nayar"], replace(m, brdf=m.brdf * off))
    pulls = {n: p for n, p in found.pulls.items() if n.startswith("reading")}
    assert max(pulls, key=lambda name: pulls[name]) == "reading 2"
    assert pulls["reading 2"] > 2
    assert found.residuals.std() == pytest.approx(1.0, abs=0.3)
    assert abs(found.residuals.mean()) < 0.3


@pytest.mark.parametrize(("sigma", "albedo", "ks"), GLOSSY)
def test_pulls_are_standard_normal(sigma: float, albedo: float, ks: float) -> None:
    model = MODELS["oren_nayar+torrance_sparrow"]
    truth = {"albedo": albedo, "sigma_deg": sigma, "ks": ks}
    pulls, chi2 = [], []
    for seed in range(20):
        found = fit(model, scan(model.name, seed, **truth))
        pulls.append([(found.values[n] - truth[n]) / (found.u[n] or np.nan) for n in truth])
        chi2.append(found.reduced_chi2)
    # 20 scans: the mean of a pull is known to 0.22, its spread to 0.16; 3.5 times that is allowed.
    assert np.all(np.abs(np.mean(pulls, axis=0)) < 0.8)
    assert np.all(np.abs(np.std(pulls, axis=0) - 1) < 0.56)
    assert np.mean(np.array(chi2, dtype=float)) == pytest.approx(1, abs=0.12)


def test_the_error_of_the_tile_affects_the_albedo_alone() -> None:
    # A model proportional to its albedo: with interreflection (34), which is not, the data would
    # separate the albedo from the error of the tile to some degree.
    model = MODELS["oren_nayar_qualitative"]
    m = scan(model.name, 5, u_tile=0.0, albedo=0.8, sigma_deg=30)
    assert m.u_random is not None
    off = replace(m, brdf=m.brdf * 1.01, u_random=m.u_random * 1.01, shared=(tile_of(m, 0.005),))
    exact, scaled = fit(model, m), fit(model, off)
    assert (exact.u["albedo"] or 1) < 0.0005
    assert scaled.u["albedo"] == pytest.approx(0.005 * 0.808, rel=0.02)
    assert scaled.values["albedo"] == pytest.approx(1.01 * exact.values["albedo"], rel=1e-5)
    assert scaled.values["sigma_deg"] == pytest.approx(exact.values["sigma_deg"], rel=1e-4)
    assert scaled.u["sigma_deg"] == pytest.approx(exact.u["sigma_deg"], rel=1e-2)
    assert scaled.chi2 == pytest.approx(exact.chi2, rel=1e-3)


def test_shared_relative_errors_do_not_pull_towards_low_points() -> None:
    # Peelle's puzzle: values 1.5 and 1.0, each with 10 % and a common 20 %, do not average 0.88.
    m = Measurements.bare(30.0, [0.0, 20.0], 0.0, [0.15, 0.10], [0.015, 0.010])
    m = replace(m, shared=(tile_of(m, 0.2),))
    found = fit(MODELS["lambert"], m)
    assert 0.10 < found.values["albedo"] / np.pi < 0.15


def test_shared_errors_do_not_absorb_the_misfit_of_a_wrong_model() -> None:
    found = fit(MODELS["lambert"], scan("oren_nayar", 2, albedo=0.8, sigma_deg=40))
    assert found.values["albedo"] == pytest.approx(0.56, abs=0.06)  # about the data's mean
    assert (found.reduced_chi2 or 0) > 1000
    assert 0.05 < found.rms_relative < 0.5


def test_without_stated_u_the_noise_is_estimated() -> None:
    m = scan("oren_nayar", 6, albedo=0.8, sigma_deg=30, u_tile=0.0, u_deg=0.0)
    bare = Measurements.bare(m.theta_i_deg, m.theta_r_deg, m.dphi_deg, m.brdf)
    found = fit(MODELS["oren_nayar"], bare)
    assert found.chi2 is None
    assert found.reduced_chi2 is None
    assert found.values["sigma_deg"] == pytest.approx(30, abs=4 * (found.u["sigma_deg"] or 0))
    assert found.rms_relative == pytest.approx(5e-4, rel=0.3)


def test_stated_u_is_that_of_the_fit_and_empty_where_nothing_is_determined() -> None:
    m = scan("oren_nayar", 1, albedo=0.8, sigma_deg=30)
    found = fit(MODELS["oren_nayar"], m)
    assert stated_u(found, m) == pytest.approx(dict(found.u), rel=0.01)
    relative = replace(m, relative=True)
    assert stated_u(fit(MODELS["lambert"], relative), relative) == {}


FOAM = "oren_nayar+torrance_sparrow"


@pytest.mark.slow
@pytest.mark.parametrize("part", ["whole", "mirror half", "first 19", "first 23"])
def test_foam_at_one_incidence_is_found(part: str, slow: bool) -> None:
    """The widths of lobes for which few points count lie between values 10 degrees apart."""
    truth = {"albedo": 0.8, "sigma_deg": 20.0, "ks": 0.076}
    for seed in range(2 if slow else 1):
        m = scan(FOAM, seed, u_relative=5e-5, acceptance=RIG, **truth)
        m = m.subset(m.theta_i_deg == 30)
        order = np.arange(m.size)
        parts = {"whole": order >= 0, "mirror half": m.theta_r_deg <= 0}
        parts |= {"first 19": order < 19, "first 23": order < 23}
        found = fit(MODELS[FOAM], m.subset(parts[part]), RIG)
        assert 0 < (found.reduced_chi2 or 9) < 2.2
        for name, value in truth.items():
            assert found.values[name] == pytest.approx(value, abs=4 * (found.u[name] or 0))


AS_LOW = 1 + 1e-6


def random_cases(slow: bool) -> list[Case]:
    """Seeded cases with two points more than parameters: 6, or with `pytest --slow` 2 000."""
    cases = map(random_case, range(2200 if slow else 6))
    return [case for case in cases if case.measurements.size >= case.truth.size + 2][:2000]


@pytest.mark.slow
def test_no_fit_is_above_the_truth_nor_above_a_special_case(slow: bool) -> None:
    """chi2 of the fit's own final problem, at the truth and at the fits of its special cases."""
    missed = []
    for case in random_cases(slow):
        found = fit(case.model, case.measurements)
        least, solved = found.solved.chi2(found.x), found.solved
        if least > solved.chi2(case.truth) * AS_LOW:
            missed.append(f"{case}: {least / solved.chi2(case.truth):g} of the truth's chi2")
        for special in special_cases(case.model):
            values = fit(MODELS[special.name], case.measurements).values
            at = special.embed(values, case.model)
            x = np.array([at[p.name] for p in case.model.parameters])
            inside = np.all((solved.low <= x) & (x <= solved.high))
            if inside and least > solved.chi2(x) * AS_LOW:
                missed.append(f"{case}: {least / solved.chi2(x):g} of the chi2 of {special.name}")
    assert not missed, missed


def test_a_spike_between_the_points_of_a_dense_scan_is_found() -> None:
    """Its width shows only where the rest of the model fits already, so on no grid."""
    case = random_case(1118, ("unified",))
    found = fit(case.model, case.measurements)
    assert found.solved.chi2(found.x) <= found.solved.chi2(case.truth) * AS_LOW


CURET = ROOT.parent / "shared" / "data" / "curet"
needs_curet = pytest.mark.skipif(
    not CURET.is_dir(), reason="the CUReT tables are not in ../shared/data"
)

COLUMNS = (
    *("lambert", "minnaert", "oren_nayar_qualitative", "oren_nayar", "oren_nayar_exact"),
    "oren_nayar+torrance_sparrow_lobe",
)

FIGURES = [
    (10, 68.8, (0.118, 0.117, 0.0527, 0.0188, 0.0213, 0.0184)),
    (11, 68.8, (0.187, 0.187, 0.1018, 0.0424, 0.0401, 0.0424)),
    (45, 68.8, (0.169, 0.164, 0.0588, 0.0350, 0.0346, 0.0234)),
    (50, 68.8, (0.142, 0.135, 0.0538, 0.0383, 0.0426, 0.0351)),
    (49, 68.8, (0.077, 0.075, 0.0284, 0.0322, 0.0414, 0.0140)),
    (10, 90.0, (0.255, 0.246, 0.0832, 0.0497, 0.0610, 0.0433)),
]


@needs_curet
@pytest.mark.parametrize(("sample", "max_theta_deg", "figures"), FIGURES)
def test_published_materials_fit_within_2_percent_of_the_reference_residuals(
    sample: int, max_theta_deg: float, figures: tuple[float, ...]
) -> None:
    m = read_curet(CURET, sample, max_theta_deg).measurements
    for name, figure in zip(COLUMNS, figures, strict=True):
        assert fit(MODELS[name], m).rms_relative == pytest.approx(figure, rel=0.02), name


@needs_curet
def test_parameters_of_the_published_plaster() -> None:
    found = fit(MODELS["oren_nayar"], read_curet(CURET, 10).measurements)
    assert found.values["albedo"] == pytest.approx(0.8484, abs=2e-4)
    assert found.values["sigma_deg"] == pytest.approx(np.degrees(0.3844), abs=0.02)
