"""Darks: light in them is refused, or taken as uncertain; an offset and dark current are not."""

from __future__ import annotations

import logging
from functools import cache

import numpy as np
import pytest

from acquisition.interlocks.darks import MOST_LIGHT, DarkCheck
from acquisition.measure.radiometry import Dark, average_dark
from acquisition.measure.window import Window, window_at
from acquisition.results.reduction import reduce
from instrument.config.load import Loaded
from instrument.config.rig import Rig
from instrument.devices import Frame
from instrument.errors import Interlock
from instrument.pinhole import Pinhole
from instrument.record.reading import Reading
from instrument.record.record import Record
from tests.support.scans import small_scan
from tests.support.whole_scans.lamp_faults import LampFault
from tests.support.whole_scans.stopped_scan import scan

RIGS = ["bench_12bit", "paper_1995"]


@cache
def rig_of(name: str) -> Rig:
    return small_scan(name).rig


def dark(rig: Rig, exposure_s: float, electrons_per_s: float, offset_dn: float, seed: int) -> Dark:
    """Dark of a rig whose pixels collect so many electrons, and whose black level is off."""
    camera, random = rig.camera, np.random.default_rng([seed, round(exposure_s * 1e9)])
    electrons = electrons_per_s * exposure_s
    spread = np.sqrt(electrons + camera.read_noise_electrons**2)
    shape = (8, camera.height_px, camera.width_px)
    counts = (electrons + spread * random.standard_normal(shape)) / camera.electrons_per_dn
    counts = np.rint(counts + camera.black_level_dn + offset_dn).clip(0, camera.max_dn)
    frames = [Frame(image.astype(np.uint16), exposure_s, 0.0) for image in counts]
    return average_dark(frames, camera)


def window(rig: Rig) -> Window:
    return window_at(20.0, Pinhole.of(rig), 20.0, 20.0)


@pytest.mark.parametrize("rig_name", RIGS)
@pytest.mark.parametrize("seed", range(5))
def test_a_warm_camera_with_another_black_level_is_accepted_and_light_is_not(
    rig_name: str, seed: int
) -> None:
    rig, random = rig_of(rig_name), np.random.default_rng(seed)
    camera, white = rig.camera, rig.lamp.white_electrons_per_s
    warm = camera.dark_current_electrons_per_s * 2.0 ** random.uniform(-3, 2)
    offset = random.uniform(-0.05, 0.05) * (camera.max_dn - camera.black_level_dn)
    offset = max(offset, -camera.black_level_dn / 2)
    exposure_s = 0.5 * camera.full_well_electrons / white * random.uniform(0.5, 2.0)
    check = DarkCheck(rig)
    reference_s = check.reference_s([exposure_s])
    assert reference_s is not None
    check.set_reference([dark(rig, reference_s, warm, offset, seed)])
    good = check.excess(dark(rig, exposure_s, warm, offset, seed), window(rig))
    assert (good.light_dn, good.is_too_much) == (0.0, False)
    # A darker camera than stated hides as much light as its dark current could be too large.
    leak = MOST_LIGHT * white * random.uniform(2.0, 20.0) + 4 * camera.dark_current_electrons_per_s
    leak += 2 * camera.electrons_per_dn / exposure_s
    check = DarkCheck(rig)
    check.set_reference([dark(rig, reference_s, warm + leak, offset, seed)])
    bad = check.excess(dark(rig, exposure_s, warm + leak, offset, seed), window(rig))
    assert bad.is_too_much
    assert bad.found_dn == pytest.approx(leak * exposure_s / camera.electrons_per_dn, rel=0.3)


@pytest.mark.parametrize("seed", range(3))
def test_light_that_a_warmer_sensor_would_explain_is_uncertain(seed: int) -> None:
    """A leak on a dark sample needs a long exposure, in which a warm sensor has as many counts."""
    rig = rig_of("paper_1995")
    stated, exposure_s = rig.camera.dark_current_electrons_per_s, 0.4
    check = DarkCheck(rig)
    check.set_reference([dark(rig, rig.camera.min_exposure_s, 3 * stated, 0.0, seed)])
    found = check.excess(dark(rig, exposure_s, 3 * stated, 0.0, seed), window(rig))
    beyond_dn = 2 * stated * exposure_s / rig.camera.electrons_per_dn
    assert not found.is_too_much
    assert 0.7 * beyond_dn < found.light_dn <= beyond_dn


def test_a_camera_with_one_exposure_is_compared_with_the_rig_files_black_level() -> None:
    loaded = small_scan()
    camera = loaded.rig.camera.model_copy(update={"max_exposure_s": 0.0005})
    lamp = loaded.rig.lamp.model_copy(update={"white_electrons_per_s": 4e7})
    rig = loaded.rig.model_copy(update={"camera": camera, "lamp": lamp})
    check = DarkCheck(rig)
    assert check.reference_s([0.0005]) is None
    assert not check.excess(dark(rig, 0.0005, 20.0, 30.0, 1), window(rig)).is_too_much
    assert check.excess(dark(rig, 0.0005, 4e6, 30.0, 1), window(rig)).is_too_much


def test_the_shortest_exposure_is_compared_with_a_longer_one() -> None:
    rig = small_scan().rig
    check = DarkCheck(rig)
    longer_s = check.reference_s([rig.camera.min_exposure_s])
    assert longer_s is not None
    assert longer_s > 2 * rig.camera.min_exposure_s


@pytest.mark.parametrize("rig_name", RIGS)
@pytest.mark.parametrize("leak", [1.0, 0.1])
def test_a_lamp_that_is_not_dark_is_darkened_again_and_then_ends_the_scan(
    rig_name: str, leak: float, record: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    fault = LampFault(leak=leak, times_open=2).install(monkeypatch)
    with pytest.raises(Interlock, match=r"darks: dark at .* DN beside black level"):
        scan(small_scan(rig_name), record, changed_devices=fault.devices)
    assert fault.times_open == 0
    assert not record.darks()


def test_an_operator_who_forgot_the_lid_is_asked_again_and_the_scan_is_as_ever(
    record: Record, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    fault = LampFault(times_open=1).install(monkeypatch)
    with caplog.at_level(logging.WARNING, "acquisition.interlocks"):
        scan(small_scan("paper_1995"), record, changed_devices=fault.devices)
    assert [m for m in caplog.messages if "taken again" in m]
    assert not any(r.flags for r in record.readings())


def test_a_shutter_that_sticks_in_mid_scan_ends_it(
    small: Loaded, record: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    scan(small, record, upto=3)
    before = len(record.readings())
    fault = LampFault(times_open=9).install(monkeypatch)
    with pytest.raises(Interlock):
        scan(small, record, changed_devices=fault.devices)
    assert len(record.readings()) == before


@pytest.mark.parametrize("leak", [0.002, 0.008])
def test_little_light_in_the_darks_is_part_of_the_uncertainty(
    leak: float,
    small: Loaded,
    whole: list[Reading],
    record: Record,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    fault = LampFault(leak=leak, times_open=99).install(monkeypatch)
    scan(small, record, changed_devices=fault.devices)
    assert [m for m in caplog.messages if "taken as uncertain" in m]
    found, good = (reduce(r, small.protocol, ()) for r in (record.readings(), whole))
    off = np.abs(found.radiance - good.radiance)
    assert np.max(off / good.u_radiance) > 3
    assert np.max(off / found.u_radiance) < 3
