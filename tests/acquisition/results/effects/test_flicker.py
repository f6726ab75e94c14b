"""Flicker that a scan's readings show together is in the noise of each, also of the first ones."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition.interlocks.frame_scatter import FLAG
from acquisition.results.effects.flicker import with_flicker
from acquisition.results.reduction import NOISE, reduced_run
from instrument.config.protocol import References
from instrument.config.simulated.defects import LampDefects
from instrument.record.reading import Check, Reading
from instrument.record.record import Record
from tests.support.scans import changed, small_scan
from tests.support.whole_scans.stopped_scan import scan

RIG = small_scan().rig
ALL_COUNTS = (1, 2, 4)


def readings(random: np.random.Generator, flicker: float, count: int = 40) -> list[Reading]:
    """Readings with the noise of pixels alone in u, whose frames scatter by flicker besides."""
    found = []
    for step in range(count):
        frames, signal = int(random.choice(ALL_COUNTS)), random.uniform(200.0, 3000.0)
        u_pixel = 0.1 * np.sqrt(signal / 1000 / frames)
        deviation = np.hypot(u_pixel * np.sqrt(frames), flicker * signal)
        scatter = float(np.std(random.normal(0, deviation, frames), ddof=1)) if frames > 1 else 0.0
        found.append(
            Reading(
                step=step, kind="point", surface="sample", theta_i_deg=30.0, dphi_deg=0.0,
                theta_r_deg=0.0, lamp_setting=0, block=0, signal_dn=signal, u_noise_dn=u_pixel,
                u_quantisation_dn=0.0, u_dark_dn=0.0, u_placement_dn=0.0, u_texture_dn=0.0,
                exposure_s=0.01, frames=frames, window_pixels=1000.0, saturated_pixels=0,
                peak_dn=2500.0, time_s=float(step), free_s=float(step), time_utc="", flags="",
                u_pixel_dn=u_pixel, scatter_dn=scatter,
            )
        )  # fmt: skip
    return found


@pytest.mark.parametrize("seed", range(20))
def test_each_reading_has_the_flicker_that_all_show(seed: int) -> None:
    random = np.random.default_rng(seed)
    flicker = float(10 ** random.uniform(-3.4, -2.6))  # 0.04 to 0.25 %: within what is allowed
    before = readings(random, flicker)
    check = Check(before_step=1, expected=1.0, u_expected=0.1, jumped=True, reading=before[0])
    after, (raised,) = with_flicker(before, [check], RIG)
    assert raised.reading == after[0]
    for old, new in zip(before, after, strict=True):
        true_u = np.hypot(old.u_pixel_dn, flicker * old.signal_dn / np.sqrt(old.frames))
        assert 0.8 < new.u_noise_dn / true_u < 1.7
        assert replace(new, u_noise_dn=old.u_noise_dn) == old
    if flicker < 0.5 * RIG.lamp.u_flicker:
        bounds = [replace(r, u_noise_dn=1.2 * r.u_noise_dn) for r in after]
        assert with_flicker(bounds, [], RIG)[0] == after  # a bound, as few readings told it


@pytest.mark.parametrize("seed", range(20))
def test_what_the_scan_found_stays_where_frames_surely_scatter_more(seed: int) -> None:
    """In a reading alone, among others for a while, or beyond all that the rig file allows."""
    random = np.random.default_rng(seed)
    before = readings(random, 0.0002, count=150)
    place = int(random.integers(10, 30))
    for k in range(place, place + 8):
        worse = 0.002 * before[k].signal_dn
        before[k] = replace(before[k], frames=4, scatter_dn=worse, u_noise_dn=worse / 2)
    after, _ = with_flicker(before, [], RIG)
    assert after[place + 7] == before[place + 7]
    beyond = [replace(r, u_noise_dn=10 * RIG.lamp.u_flicker * r.signal_dn) for r in before]
    assert with_flicker(beyond, [], RIG)[0] == beyond


@pytest.mark.parametrize("seed", range(20))
def test_a_steady_lamp_changes_nothing(seed: int) -> None:
    """Nor does one reading whose frames differ, nor do readings without their scatter."""
    random = np.random.default_rng(seed)
    steady = readings(random, 0.0)
    assert with_flicker(steady, [], RIG)[0] == steady
    bad = [replace(steady[0], frames=2, scatter_dn=500.0, flags=FLAG), *steady[1:]]
    assert with_flicker(bad, [], RIG)[0] == bad
    older = [replace(r, u_pixel_dn=0.0, scatter_dn=0.0) for r in readings(random, 0.002)]
    assert with_flicker(older, [], RIG)[0] == older
    assert with_flicker([], [], RIG) == ([], [])


def test_a_scan_without_a_tile_has_the_flicker_in_its_first_points(tmp_path: Path) -> None:
    """While they are measured, nothing but their own two frames is known."""
    flicker, small = 0.0015, small_scan(shrink=8)
    lamp = LampDefects(flicker=flicker)
    simulation = small.rig.simulation.model_copy(update={"lamp_defects": lamp})
    loaded = changed(
        small, rig={"simulation": simulation}, references=References(), frames_per_point=2
    )
    with Record.create(tmp_path / "run", {}) as record:
        scan(loaded, record)
        noise = reduced_run(record, loaded).components[NOISE]
        own = [r.u_noise_dn / r.signal_dn for r in record.readings()]
    assert np.min(own) < 0.4 * flicker
    assert np.min(noise) > 0.6 * flicker
