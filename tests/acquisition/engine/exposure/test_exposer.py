"""Exposer: exposures within the target, and a dark for each of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acquisition.engine.exposure.search import ExposureSearch
from acquisition.measure.window import Window
from acquisition.rig import open_devices
from instrument.config.load import Loaded, load_protocol
from instrument.config.simulated.sample import SimulatedSample
from instrument.devices import Frame
from instrument.record.record import Record
from tests.support.paths import CONFIGS
from tests.support.scans import changed, shrunk, small_scan
from tests.support.stand_ins import Spy
from tests.support.whole_scans.stopped_scan import scan


def test_a_dark_is_taken_at_every_exposure_used(small: Loaded, record: Record) -> None:
    scan(small, record)
    used = {r.exposure_s for r in record.readings()}
    assert {dark[0] for dark in record.darks()} == used


def test_by_hand_the_darks_come_first_and_the_lamp_is_covered_once(record: Record) -> None:
    demo = load_protocol(CONFIGS / "protocols" / "demo.yaml", CONFIGS / "rigs" / "paper_1995.yaml")
    sweep = {"theta_i_deg": [30.0, 60.0], "dphi_deg": [0.0], "theta_r_deg": [-40.0, 0.0, 50.0]}
    loaded, calls = changed(shrunk(demo, 4), sweeps=[sweep]), []
    devices = open_devices(loaded)
    lamp = Spy(devices.lamp, calls, "lamp")
    scan(loaded, record, changed_devices=lambda _: replace(devices, lamp=lamp))  # type: ignore[arg-type]  # a spy
    assert [c for c in calls if c != "lamp.identity"] == ["lamp.darken", "lamp.light"]
    assert {r.exposure_s for r in record.readings()} <= {dark[0] for dark in record.darks()}
    told = [text for _, kind, text in record.events() if kind == "operator"]
    assert sum("theta_i set to" in text for text in told) == 2
    assert [text for text in told if "covered" in text] == [
        "lamp covered for the darks",
        "lamp uncovered",
    ]


def test_the_brightest_part_of_the_window_stays_within_the_target(record: Record) -> None:
    loaded = small_scan(shrink=2)
    scan(loaded, record)
    camera, target = loaded.rig.camera, loaded.protocol.exposure_target
    full = camera.max_dn - camera.black_level_dn
    level = np.array([(r.peak_dn - camera.black_level_dn) / full for r in record.readings()])
    assert np.all(level < target * 1.03)
    assert np.all(level > target / 2**0.5 / 1.1)  # the ladder's step is sqrt 2


def test_most_points_of_a_real_bench_need_no_second_exposure(
    record: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    """64 of 496 needed one in scans with 33 view angles; here they lie farther apart."""
    tried = frames_tried(monkeypatch)
    views = {
        "theta_i_deg": [30.0],
        "dphi_deg": [0.0],
        "theta_r_deg": np.arange(-80, 81, 8).tolist(),
    }
    scan(changed(small_scan("bench_real"), sweeps=[views], frames_per_point=1), record)
    assert len(tried) == len(record.readings()) > 20
    assert sum(count > 1 for count in tried) <= len(tried) / 3
    assert max(tried) <= 3


def test_a_gloss_lobe_is_saturated_only_at_the_shortest_exposure(
    record: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A single exposure has range enough for the window's mean, but where it cannot be shorter."""
    tried = frames_tried(monkeypatch)
    gloss = SimulatedSample(
        model="lambert+ggx", parameters={"albedo": 0.03, "f0": 0.9, "alpha": 0.043}
    )
    sweep = {
        "theta_i_deg": [60.0], "dphi_deg": [0.0], "theta_r_deg": [-75.0, -70.0, -60.0, -50.0, 0.0],
    }  # fmt: skip
    loaded = changed(small_scan(), sweeps=[sweep], simulated_sample=gloss, frames_per_point=1)
    scan(loaded, record)
    points = [r for r in record.readings() if r.kind == "point"]
    shortest_s = loaded.rig.camera.min_exposure_s
    saturated = [r for r in points if "saturated" in r.flags]
    assert 0 < len(saturated) < len(points)
    assert all(r.exposure_s == shortest_s for r in saturated)
    others = [r for r in points if not r.flags]
    assert all(r.u_light_dn < 0.001 * r.signal_dn for r in others)
    assert max(r.exposure_s for r in others) > 16 * shortest_s
    assert max(tried) > 2  # a saturated window is measured again


def frames_tried(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Numbers of exposures tried at each reading, as the scan goes on."""
    tried: list[int] = []
    search = ExposureSearch.frames

    def counted(self: ExposureSearch, first_s: float, window: Window) -> list[Frame]:
        found = search(self, first_s, window)
        tried.append(len(found))
        return found

    monkeypatch.setattr(ExposureSearch, "frames", counted)
    return tried
