"""Stray light of a run: found from the dark patch, subtracted, and honest about what is unknown."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from acquisition.measure.scattering import stray_light
from acquisition.measure.stray_light import BRIGHT, white_dn
from acquisition.results.effects.lens import STRAY
from acquisition.results.reduction import Reduced, reduced_run
from instrument.geometry import FloatArray
from instrument.record.reading import Reading
from instrument.record.record import Record
from tests.support.scans import small_scan
from tests.support.storage.sample_records import reading
from tests.support.whole_scans.dark_patches import TRAP, with_patch
from tests.support.whole_scans.stopped_scan import scan

SMALL = small_scan(shrink=4)
DARK = TRAP.model_copy(update={"reflectance": 0.0005, "u_reflectance": 0.0002})
RIG = with_patch(SMALL, DARK).rig
# Of the light of a square sample, what three Gaussians scatter into window and patch, at normal and
# at grazing view, as seen in simulated pictures: near, middle, far.
NORMAL, GRAZING = ((0.99, 0.92, 0.36), (0.21, 0.36, 0.25)), ((0.8, 0.3, 0.06), (0.2, 0.13, 0.04))


def readings_of(shares: FloatArray, reflectance: float) -> tuple[list[Reading], FloatArray]:
    """Readings with this scattering (3,) and reflectance of the patch, and their stray light."""
    found, true = [], []
    for step, grazing in enumerate(np.linspace(0.0, 1.0, 12)):
        into = 1000.0 * (np.array(NORMAL) * (1 - grazing) + np.array(GRAZING) * grazing)
        own = reflectance * white_dn(RIG, 30.0, 0.01)
        names = [f"{n}_{w}_dn" for w in ("window", "patch") for n in ("near", "middle", "far")]
        values = dict(zip(names, into.ravel().tolist(), strict=True))
        level = float(into[1] @ shares) + own
        own_values = {"patch_dn": level, "u_patch_dn": 0.01, "exposure_s": 0.01, **values}
        found.append(reading(step, **own_values))
        true.append(float(into[0] @ shares))
    return found, np.array(true)


def test_the_stray_light_is_found_within_its_uncertainty() -> None:
    """Over lenses that scatter 0.3 to 3 % anyhow; what is left is far less than what was there."""
    random = np.random.default_rng(7)
    pulls, left = [], []
    for _ in range(60):
        total = 10 ** random.uniform(-2.5, -1.5)
        shares = total * random.dirichlet([1.0, 1.0, 1.0])
        reflectance = max(DARK.reflectance + DARK.u_reflectance * random.standard_normal(), 0.0)
        readings, true = readings_of(shares, reflectance)
        found = stray_light(readings, RIG)
        assert found is not None
        u = np.sqrt(np.sum(found.errors_dn**2, axis=0))
        pulls.append((found.dn - true) / u)
        left.append(np.abs(found.dn - true) / true)
    assert 0.3 < np.sqrt(np.mean(np.square(pulls))) < 1.2
    assert np.median(left) < 0.15


def test_a_flagged_reading_says_nothing_of_the_lens() -> None:
    readings, _ = readings_of(np.array([0.004, 0.004, 0.004]), DARK.reflectance)
    clean = stray_light(readings[1:], RIG)
    covered = replace(readings[0], patch_dn=900.0, flags=BRIGHT)
    spoilt = stray_light([covered, *readings[1:]], RIG)
    assert clean is not None
    assert spoilt is not None
    np.testing.assert_array_equal(spoilt.dn[1:], clean.dn)


def test_a_drift_check_keeps_its_signal_as_one_at_a_resume_does() -> None:
    readings, true = readings_of(np.array([0.004, 0.004, 0.004]), DARK.reflectance)
    readings[3] = replace(readings[3], kind="drift")
    found = stray_light(readings, RIG)
    assert found is not None
    light = [r.signal_dn for r in found.subtracted(readings)]
    assert light[3] == readings[3].signal_dn
    assert abs(readings[4].signal_dn - light[4] - true[4]) < 0.2 * true[4]


def test_without_a_patch_or_a_picture_of_it_there_is_nothing_to_subtract() -> None:
    readings, _ = readings_of(np.array([0.004, 0.004, 0.004]), DARK.reflectance)
    assert stray_light(readings, SMALL.rig) is None
    assert stray_light([reading(0)], RIG) is None


def reduced(folder: Path, patch: bool, glare: float) -> Reduced:
    loaded = with_patch(SMALL, DARK if patch else None, glare=glare)
    with Record.create(folder, {}) as record:
        scan(loaded, record)
        return reduced_run(record, loaded)


def test_a_scan_through_a_lens_with_glare_gives_the_brdf_without(tmp_path: Path) -> None:
    """2 % of glare costs 0.5 % at 70 deg; with the patch less than a sixth of it is left."""
    sound = reduced(tmp_path / "sound", patch=False, glare=0.0)
    plain = reduced(tmp_path / "plain", patch=False, glare=0.02)
    found = reduced(tmp_path / "found", patch=True, glare=0.02)
    assert not any(found.flags)
    at_70 = np.abs([p.theta_r_deg for p in found.points]) == 70.0
    before, after = (float(np.abs(r.brdf / sound.brdf - 1)[at_70].mean()) for r in (plain, found))
    assert before > 0.003
    assert after < before / 6
    assert STRAY not in plain.parts
    u = found.parts[STRAY][at_70]
    assert np.all((u > after / 4) & (u < before / 3))
