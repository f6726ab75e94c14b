"""Exposer: exposures within the target, and a dark for each of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acquisition.rig import open_devices
from instrument.config.load import Loaded, load_protocol
from instrument.record.record import Record
from tests.support.paths import CONFIGS
from tests.support.scans import changed, small_scan
from tests.support.stand_ins import Spy
from tests.support.whole_scans.stopped_scan import scan


def test_a_dark_is_taken_at_every_exposure_used(small: Loaded, record: Record) -> None:
    scan(small, record)
    used = {r.exposure_s for r in record.readings()}
    assert {dark[0] for dark in record.darks()} == used


def test_by_hand_the_darks_come_first_and_the_lamp_is_covered_once(record: Record) -> None:
    demo = load_protocol(CONFIGS / "protocols" / "demo.yaml", CONFIGS / "rigs" / "paper_1995.yaml")
    sweep = {"theta_i_deg": [30.0, 60.0], "dphi_deg": [0.0], "theta_r_deg": [-40.0, 0.0, 50.0]}
    loaded, calls = changed(demo, sweeps=[sweep]), []
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
    loaded = small_scan(shrink=1)
    scan(loaded, record)
    camera, target = loaded.rig.camera, loaded.protocol.exposure_target
    full = camera.max_dn - camera.black_level_dn
    level = np.array([(r.peak_dn - camera.black_level_dn) / full for r in record.readings()])
    assert np.all(level < target * 1.03)
    assert np.all(level > target / 2**0.5 / 1.1)  # the ladder's step is sqrt 2
