"""Simulated scans: errors against stated uncertainty and photon limit, and cost of a scan."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import pytest

from acquisition.benchmark import demo_scan
from acquisition.benchmark.demo_scan import demonstration
from acquisition.benchmark.studies.scan import photon_limit, scan_study
from acquisition.engine.engine import Engine
from acquisition.plan.plan import make_plan
from acquisition.rig import open_devices
from instrument.config.protocol import Steps
from instrument.devices import Camera, Frame
from instrument.record.record import Record
from tests.support.benchmark import FEW, trial_of
from tests.support.scans import changed, shrunk
from tests.support.stand_ins import PassThrough


@pytest.fixture
def few_points(monkeypatch: pytest.MonkeyPatch) -> None:
    """The demonstration with one incidence, every 8 degrees: a fifth of its points.

    And a quarter of its pixels, of an even sample: coarse pixels would cut mottling at the edge.
    """
    shipped = shrunk(demo_scan.shipped_demo(), 2)
    sample, window = shipped.protocol.simulated_sample, shipped.protocol.window
    assert sample is not None
    views = Steps(start=-80.0, stop=80.0, num=21)
    sweep = {**shipped.protocol.sweeps[0], "theta_i_deg": [45.0], "theta_r_deg": views}
    smaller = changed(
        shipped,
        sweeps=[sweep],
        simulated_sample=sample.model_copy(update={"mottling": 0.0}),
        window=window.model_copy(update={"min_pixels": window.min_pixels // 4}),
    )
    monkeypatch.setattr(demo_scan, "shipped_demo", lambda: smaller)


@pytest.mark.usefixtures("few_points")
def test_errors_are_as_stated_and_above_the_photon_limit() -> None:
    """With two scans an rms is within a factor of 4 of its expectation, or below it.

    In 99 of 100 cases (chi-square, two degrees of freedom: 9.2 = (3.0)^2 and, of the mean, 2.1^2).
    """
    study = scan_study(FEW)
    for scene in study.scenes:
        for trial in study.in_scene(scene):
            if trial.bound:
                continue
            stated = trial.more["u_stated_relative"]
            assert stated > trial_of(study, scene, f"photons: {trial.label}").error
            assert trial.error < 4 * stated
        minutes = {t.label: t.cost for t in study.in_scene(scene)}
        for less in ("step 10°", "1 frame", "exposed to 5%"):
            assert minutes[less] < minutes["demonstration"]


def test_four_times_the_frames_halve_the_photon_limit() -> None:
    limits = [
        photon_limit(loaded, make_plan(loaded))
        for loaded in (demonstration(frames=2), demonstration(frames=8))
    ]
    for name, limit in limits[0].items():
        assert limits[1][name] == pytest.approx(limit / 2, rel=1e-9)


class TimedCamera(PassThrough):
    """A camera that counts the CPU seconds of its rendering."""

    def __init__(self, camera: Camera) -> None:
        super().__init__(camera)
        self._camera, self.seconds = camera, 0.0

    def grab(self, count: int) -> list[Frame]:
        begun = time.process_time()
        frames = self._camera.grab(count)
        self.seconds += time.process_time() - begun
        return frames


def test_the_rest_of_a_scan_costs_at_most_a_few_times_its_rendering(tmp_path: Path) -> None:
    """Measured with coarse pixels, binned 4 x 4: 0.9 times. With all pixels rendering dominates."""
    loaded = demonstration(views=9)
    devices = open_devices(loaded)
    camera = TimedCamera(devices.camera)
    try:
        with Record.create(tmp_path / "run", {}) as record:
            watched, steps = replace(devices, camera=camera), []
            engine = Engine(loaded.protocol, loaded.rig, watched, record, steps.append)
            begun = time.process_time()
            engine.run(make_plan(loaded))
            whole = time.process_time() - begun
            assert len(record.readings()) == len(steps) == len(make_plan(loaded).steps)
    finally:
        devices.close()
    assert whole - camera.seconds < 3 * camera.seconds
