"""Exposures checked by light: no wrong exposure is believed, no sound camera is refused."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.engine.engine import Devices
from acquisition.engine.exposure.check import ExposureCheck
from acquisition.measure.linearity import LEAST_RATIO
from acquisition.plan.exposure_ladder import exposure_ladder_s
from acquisition.results.reduction import reduced_run
from acquisition.rig import open_devices
from instrument.config.camera import CameraDefects
from instrument.config.load import Loaded
from instrument.config.simulated.sample import SimulatedSample
from instrument.devices import Camera, Frame
from instrument.errors import DeviceError
from instrument.record.record import Record
from sim.clock import SimulatedClock
from tests.support.scans import changed, small_scan, undated
from tests.support.whole_scans.stopped_scan import scan

GREY = 0.18
CAMERA = small_scan().rig.camera


def grey_card(
    defects: dict[str, Any], rig: str = "bench_12bit", seed: int = 2026, drift: float = 0.01
) -> Loaded:
    """A scan of a grey card and a white tile by a camera with these defects."""
    small = small_scan(rig)
    simulation = small.rig.simulation.model_copy(
        update={
            "camera_defects": CameraDefects.model_validate(defects),
            "seed": seed,
            "lamp_drift_per_hour": drift,
        }
    )
    sample = SimulatedSample(model="lambert", parameters={"albedo": GREY})
    return changed(small, rig={"simulation": simulation}, simulated_sample=sample)


@pytest.fixture
def new_record(tmp_path: Path) -> Iterator[Record]:
    with Record.create(tmp_path / "run", {}) as record:
        yield record


@pytest.mark.parametrize(
    "defects",
    [
        {"fixed_exposure_s": 0.0157},
        {"fixed_exposure_s": 0.0005},
        {"longest_exposure_s": 0.033},
        {"longest_exposure_s": 0.06},
        {"exposures_s": [0.0005 * 2**n for n in range(13)]},
    ],
)
def test_an_exposure_that_the_camera_does_not_make_stops_the_scan(
    new_record: Record, defects: dict[str, Any]
) -> None:
    """The white tile needs 25 ms and the grey card 140 ms; the camera says that it took them."""
    with pytest.raises(DeviceError, match=r"camera: counts at .* does not expose as long as it"):
        scan(grey_card(defects), new_record)
    wrong = {r.exposure_s for r in new_record.readings()}
    fixed, longest = defects.get("fixed_exposure_s"), defects.get("longest_exposure_s", 10)
    assert fixed not in wrong
    assert all(exposure_s <= longest * 1.01 for exposure_s in wrong)


@pytest.mark.parametrize("gamma", [1.8, 2.2, 2.4])
def test_a_gamma_that_is_left_on_is_named(new_record: Record, gamma: float) -> None:
    words = r"a gamma of ([\d.]+) that is left on: .*gonio calibrate camera"
    with pytest.raises(DeviceError, match=words) as stopped:
        scan(grey_card({"gamma": gamma}), new_record)
    found = re.search(words, str(stopped.value))
    assert found is not None
    assert float(found[1]) == pytest.approx(gamma, abs=0.2)


@pytest.mark.parametrize("upto", [10, 13])
def test_a_camera_that_has_changed_before_a_resume_is_found(new_record: Record, upto: int) -> None:
    """A lamp that drifts fast shows that the check's time is no scan time."""
    sound = grey_card({}, drift=0.9)
    scan(sound, new_record, upto=upto)
    before = new_record.readings()
    shorter = [e * (0.9 if e > 0.1 else 1) for e in exposure_ladder_s(CAMERA)]
    with pytest.raises(DeviceError, match=r"does not expose as long as it"):
        scan(grey_card({"exposures_s": shorter}, drift=0.9), new_record)
    assert new_record.readings() == before
    scan(sound, new_record)
    with Record.create(new_record.folder / "whole", {}) as whole:
        scan(sound, whole)
        assert undated(new_record.readings()) == undated(whole.readings())


class StampedCamera:
    """Forwards to a camera whose light is right, and stamps its frames every 33 ms.

    `series`: whether those of a series of this length have stamps.
    """

    def __init__(self, camera: Camera, series: Callable[[int], bool]) -> None:
        self._camera, self._series, self._number = camera, series, 0

    def __getattr__(self, name: str) -> object:
        return getattr(self._camera, name)

    def grab(self, count: int) -> list[Frame]:
        frames = self._camera.grab(count)
        first, self._number = self._number, self._number + count
        if not self._series(count):
            return frames
        return [replace(f, device_time_s=0.033 * (first + n)) for n, f in enumerate(frames)]


DARK_FRAMES = small_scan().protocol.dark_frames


@pytest.mark.parametrize(
    "series", [lambda count: count < DARK_FRAMES, lambda count: count == DARK_FRAMES],
    ids=["of the sample", "darks"],
)  # fmt: skip
def test_frames_that_follow_one_another_too_fast_stop_the_scan(
    new_record: Record, series: Callable[[int], bool]
) -> None:
    def stamped(devices: Devices) -> Devices:
        return replace(devices, camera=StampedCamera(devices.camera, series))  # type: ignore[arg-type]  # forwards

    with pytest.raises(DeviceError, match=r"its frames come every 0.033 s, .* max_exposure_s"):
        scan(grey_card({}), new_record, changed_devices=stamped)
    assert all(r.exposure_s < 0.04 for r in new_record.readings())


@pytest.mark.parametrize(
    ("rig", "seed"), [("bench_12bit", 1), ("bench_12bit", 2), ("paper_1995", 3)]
)
def test_a_sound_camera_is_confirmed_at_every_exposure_that_the_scan_uses(
    new_record: Record, rig: str, seed: int
) -> None:
    loaded = grey_card({}, rig, seed)
    scan(loaded, new_record)
    texts = [text for _, kind, text in new_record.events() if kind == "exposure"]
    used = {r.exposure_s for r in new_record.readings()}
    assert len(texts) >= len(used) - 1
    for exposure_s in used:
        assert any(f"{exposure_s:g} s" in text for text in texts), exposure_s


@pytest.mark.parametrize(("error", "warned"), [(0.0, False), (0.003, False), (0.012, True)])
def test_a_small_deviation_is_a_warning(
    new_record: Record, caplog: pytest.LogCaptureFixture, error: float, warned: bool
) -> None:
    """Exposures above 20 ms are longer than the camera says."""
    ladder = exposure_ladder_s(CAMERA)
    table = [e * (1 + error * (e > 0.02)) for e in ladder]
    scan(grey_card({"exposures_s": table}), new_record)
    assert any("may differ by as much" in text for text in caplog.messages) == warned


@pytest.mark.parametrize("step_s", [0.0016, 0.005])
def test_a_rounded_exposure_that_is_confirmed_is_used(new_record: Record, step_s: float) -> None:
    table = [step_s * n for n in range(1, 1000)]
    loaded = grey_card({"exposures_s": table, "reads_back": "taken"})
    scan(loaded, new_record)
    used = {r.exposure_s for r in new_record.readings()}
    assert used <= set(table)
    assert not used <= set(exposure_ladder_s(loaded.rig.camera))
    assert {dark[0] for dark in new_record.darks()} == used
    reduced = reduced_run(new_record, loaded)
    assert reduced.brdf * 3.14159265 == pytest.approx(GREY, rel=0.03)


@given(
    rungs=st.lists(st.integers(0, 22), min_size=1, max_size=60), overhead_s=st.floats(0.0, 0.3),
    takes=st.floats(0.1, 4.0),
)  # fmt: skip
def test_no_sequence_of_exposures_costs_more(
    rungs: list[int], overhead_s: float, takes: float
) -> None:
    """Nothing is ever confirmed; a frame takes up to four exposures and read-outs."""
    camera = CAMERA.model_copy(update={"frame_overhead_s": overhead_s})
    ladder, clock = exposure_ladder_s(camera), SimulatedClock()
    check = ExposureCheck(camera, clock, clock.now_s, None)  # type: ignore[arg-type]  # not written to
    for exposure_s in (ladder[rung] for rung in rungs):
        shorter_s = check.comparison_s(exposure_s)
        if shorter_s is not None:
            assert shorter_s <= exposure_s / LEAST_RATIO
            with check.timed():
                clock.sleep(takes * (shorter_s + overhead_s))
    assert check.spent_s <= 2 + 2 * max(ladder[rung] for rung in rungs)


@pytest.mark.parametrize("albedo", [0.9, 0.02])
def test_the_check_takes_two_seconds_and_two_exposures_at_most(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, albedo: float
) -> None:
    sample = SimulatedSample(model="lambert", parameters={"albedo": albedo})
    loaded = changed(grey_card({}), simulated_sample=sample)
    taken_s = []
    for checked in (True, False):
        if not checked:
            monkeypatch.setattr(ExposureCheck, "comparison_s", lambda *_: None)
        with Record.create(tmp_path / str(checked), {}) as record:
            devices = open_devices(loaded)
            scan(loaded, record, changed_devices=lambda _, devices=devices: devices)
            taken_s.append(devices.clock.now_s())
            longest_s = max(r.exposure_s for r in record.readings())
    assert 0 < taken_s[0] - taken_s[1] < 2 + 2 * longest_s
