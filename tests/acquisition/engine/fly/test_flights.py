"""Scan of an axis that turns: angles within their u, and stops, faults and pauses cost nothing."""

from __future__ import annotations

import random
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition.engine.engine import Devices, Engine
from acquisition.engine.pause import PauseSwitch
from acquisition.engine.resume import Progress
from acquisition.plan.plan import Step, make_plan
from acquisition.results.effects.turning import smear, turning_note
from acquisition.results.fitting import fit_run
from acquisition.results.measurements_csv import measurements_csv
from acquisition.results.reduction import reduced_run
from acquisition.rig import open_devices
from analysis.data.csv.table import read_table
from instrument.config.load import Loaded
from instrument.config.protocol import References, Steps
from instrument.errors import ComputerPaused, DeviceError
from instrument.record.event_kinds import LATENCY
from instrument.record.reading import Reading
from instrument.record.record import Record
from sim.faults.faults import Faults
from tests.support.flights.fly_scans import (
    fly_scan,
    narrow_lobe_scan,
    rates_at_rest,
    with_latency,
)
from tests.support.scans import changed
from tests.support.stand_ins import PassThrough
from tests.support.whole_scans.stopped_scan import scan


@pytest.fixture(scope="module")
def flown() -> Loaded:
    return with_latency(fly_scan(), 0.012)


@pytest.fixture(scope="module")
def whole(flown: Loaded, tmp_path_factory: pytest.TempPathFactory) -> list[Reading]:
    with Record.create(tmp_path_factory.mktemp("whole") / "run", {}) as record:
        scan(flown, record)
        return record.readings()


def points(readings: Sequence[Reading]) -> list[Reading]:
    return [reading for reading in readings if reading.kind == "point"]


def assert_same_within_u(loaded: Loaded, some: Sequence[Reading], other: Sequence[Reading]) -> None:
    """Each step is read once; its light, of a matt sample, is the same, and the angle nearly."""
    assert [r.step for r in some] == [r.step for r in other]
    steps = make_plan(loaded).steps
    for one, two in zip(points(some), points(other), strict=True):
        ratio = one.signal_dn / one.exposure_s / (two.signal_dn / two.exposure_s)
        assert ratio == pytest.approx(1.0, abs=0.01)
        nominal = steps[one.step].pose.theta_r
        assert abs(one.theta_r_deg - nominal) < 1.0
        assert abs(two.theta_r_deg - nominal) < 1.0


def test_every_angle_has_one_frame_with_its_blur_and_u(flown: Loaded, whole: list[Reading]) -> None:
    steps = make_plan(flown).steps
    assert [r.step for r in whole] == [s.index for s in steps]
    axis, camera = flown.rig.axes.theta_r, flown.rig.camera
    for reading in points(whole):
        assert reading.frames == 1
        assert 0 < reading.blur_deg <= axis.speed_deg_per_s * reading.exposure_s
        assert reading.blur_deg <= 0.93  # what u_blur allows of a lobe of 10 degrees
        assert 0 <= reading.u_turn_deg < 0.1
        assert 0 < abs(reading.u_latency_deg) < 0.05
    for reading in whole:
        if reading.kind != "point":
            assert (reading.blur_deg, reading.u_turn_deg, reading.u_latency_deg) == (0, 0, 0)
    signs = {r.lamp_setting: set[float]() for r in points(whole)}
    for reading in points(whole):
        signs[reading.lamp_setting].add(np.sign(reading.u_latency_deg))
    assert sorted(map(tuple, signs.values())) == [(-1.0,), (1.0,)]  # there, and back
    assert camera.min_exposure_s < whole[-1].exposure_s


def test_the_latency_is_found_and_recorded(flown: Loaded, tmp_path: Path) -> None:
    chosen = random.Random(3)
    for number in range(2):
        latency_s = chosen.uniform(-0.04, 0.04)
        with Record.create(tmp_path / str(number), {}) as record:
            scan(with_latency(flown, latency_s), record)
            found = [text for _, kind, text in record.events() if kind == LATENCY]
        assert len(found) == 1  # of two sweeps at one exposure
        value_ms, u_ms = (float(part.split()[0]) for part in found[0].split("s: ")[1].split("u "))
        assert abs(value_ms - 1e3 * latency_s) < 4 * u_ms
        assert u_ms < 3.0


@pytest.mark.slow
def test_a_lobe_2_degrees_wide_is_unbiased_within_u(tmp_path: Path, slow: bool) -> None:
    """The light of each frame against that at rest at its angle, in units of u without the lamp."""
    chosen, pulls, peaks = np.random.default_rng(5), [], []
    for number in range(20 if slow else 1):
        loaded = narrow_lobe_scan(chosen)
        with Record.create(tmp_path / str(number), {}) as record:
            scan(loaded, record)
            own = record.readings()
        angles, theta_i = np.array([r.theta_r_deg for r in own]), own[0].theta_i_deg
        rate = np.array([r.signal_dn / r.exposure_s for r in own])
        expected = rates_at_rest(loaded, theta_i, angles)
        slope = (rates_at_rest(loaded, theta_i, angles + 0.01) - expected) / 0.01
        u_angle = [np.hypot(r.u_turn_deg, r.u_latency_deg) for r in own] * np.abs(slope)
        u_light = [np.hypot(r.u_noise_dn, r.u_quantisation_dn) / r.exposure_s for r in own]
        u_reading = np.sqrt(np.square(u_light) + u_angle**2 + (smear(own, rate) * rate) ** 2)
        pull = (rate - expected) / np.hypot(u_reading, 1e-4 * rate)  # of the render's cosine^4
        assert expected.max() > 1.3 * expected.min()
        assert max(r.blur_deg for r in own) < 0.2
        pulls += pull.tolist()
        peaks.append(pull[np.argmax(expected)])
    assert abs(np.mean(pulls)) < 0.3
    assert np.sqrt(np.mean(np.square(pulls))) < 1.2
    assert abs(np.mean(peaks)) < 1.0


def test_sweeps_are_flown_in_a_quarter_of_the_time_of_their_stops(tmp_path: Path) -> None:
    """From the first to the last angle, ways between sweeps included, with as many frames.

    At the demonstration's angles; its third sweep would change little.
    """
    loaded = fly_scan(133, shrink=16)
    sweep = {**loaded.protocol.sweeps[0], "theta_i_deg": [30.0, 45.0]}
    loaded = changed(loaded, references=References())
    flown, stops = (
        changed(loaded, sweeps=[sweep | {"theta_r_deg": Steps(start=-80, stop=80, num=num)}])
        for num in (133, 33)
    )
    stops = changed(stops, motion="stepped", frames_per_point=4)
    taken, frames = list[float](), list[int]()
    for number, one in enumerate((flown, stops)):
        with Record.create(tmp_path / str(number), {}) as record:
            scan(one, record)
            own = record.readings()
        taken.append(own[-1].time_s - own[0].time_s)
        frames.append(sum(reading.frames for reading in own))
    assert frames[0] >= frames[1]
    assert taken[0] < taken[1] / 4


def test_cut_anywhere_it_goes_on_at_the_first_missing_angle(
    flown: Loaded, whole: list[Reading], tmp_path: Path
) -> None:
    chosen = random.Random(8)
    for number in range(2):
        upto = chosen.choice([r.step for r in points(whole)][:-1])
        with Record.create(tmp_path / str(number), {}) as record:
            scan(flown, record, upto)
            kept = record.readings()
            assert [r.step for r in kept] == [r.step for r in whole[: len(kept)]]
            assert kept[-1].step == upto
            scan(flown, record)
            assert record.readings()[: len(kept)] == kept
            assert_same_within_u(flown, record.readings(), whole)
            assert not any(check.jumped for check in record.checks())


def test_a_pause_in_a_turn_ends_it_and_costs_no_reading(
    flown: Loaded, whole: list[Reading], record: Record
) -> None:
    chosen = random.Random(9)
    after = set(chosen.sample([r.step for r in points(whole)][:-1], 3))
    said: list[str] = []

    def on_step(step: Step) -> None:
        if step.index in after:
            switch.turn(on=True, by="in a test")

    def say(text: str) -> None:
        said.append(text)
        switch.turn(on=False, by="in a test")

    switch = PauseSwitch(say)
    devices = open_devices(flown)
    plan = make_plan(flown)
    Engine(flown.protocol, flown.rig, devices, record, on_step, pause=switch).run(plan)
    assert len(said) == 2 * len(after)
    assert_same_within_u(flown, record.readings(), whole)


@pytest.mark.parametrize("fault", ["stalls", "slips"])
def test_a_fault_in_a_turn_ends_the_scan_and_a_resume_completes_it(
    flown: Loaded, whole: list[Reading], record: Record, fault: str
) -> None:
    faults = Faults(f"theta_r {fault} after camera.grab 70")
    devices = open_devices(flown, faults)
    with pytest.raises(DeviceError, match="theta_r"):
        Engine(flown.protocol, flown.rig, devices, record, [].append).run(make_plan(flown))
    assert 2 < len(record.readings()) < len(whole)
    scan(flown, record)
    assert_same_within_u(flown, record.readings(), whole)


def test_after_a_pause_of_the_computer_the_rest_is_flown(
    flown: Loaded, whole: list[Reading], record: Record
) -> None:
    class Paused(PassThrough):
        """Axis whose turn the watchdog has stopped once, in the middle."""

        turns = 0

        def finish_move(self) -> None:
            self.turns += 1
            if self.turns == 8:
                raise ComputerPaused("theta_r: the computer paused for 3 s")
            axes["theta_r"].finish_move()

    def changed_devices(devices: Devices) -> Devices:
        axes.update(devices.axes)
        return replace(devices, axes=axes | {"theta_r": Paused(axes["theta_r"])})  # type: ignore[dict-item]  # a stand-in

    axes: dict[str, object] = {}
    scan(flown, record, changed_devices=changed_devices)
    assert_same_within_u(flown, record.readings(), whole)


def test_values_carry_the_blur_and_the_errors_of_the_angles(flown: Loaded, record: Record) -> None:
    scan(flown, record)
    reduced = reduced_run(record, flown)
    assert not any(reduced.flags)
    assert np.all(reduced.parts["blur in angle"] < 0.01)
    shared = {error.name: error for error in reduced.shared}
    own = np.array([p.u_latency_deg for p in reduced.points])
    assert np.array_equal(shared["latency of the frames"].theta_r_deg, own)
    assert np.unique(shared["angle of a moving frame"].group).size == len(reduced.points)
    assert re.search(r"by up to 0\.\d+ deg in one exposure", turning_note(reduced.points))
    assert Progress.of(record).missing(make_plan(flown)) == ()


def test_a_fit_knows_the_turn_of_each_frame_from_the_run_and_from_its_table(
    flown: Loaded, record: Record, tmp_path: Path
) -> None:
    """The blur is part of the u of a value, which is a mean, but not of what the fit takes."""
    scan(flown, record)
    reduced = reduced_run(record, flown)
    fitted = fit_run(reduced, flown)
    m, u_brdf = fitted.measurements, fitted.u_brdf(reduced)
    assert m is not None
    assert fitted.chosen is not None
    assert np.array_equal(m.blur_deg, [p.blur_deg for p in reduced.points])
    assert np.all(m.blur_deg > 0)
    blurred = reduced.parts["blur in angle"] * np.abs(m.brdf)
    assert u_brdf == pytest.approx(np.hypot(fitted.chosen.u_total, blurred))
    path = tmp_path / "measurements.csv"
    path.write_text(measurements_csv(reduced, u_brdf, fitted.parts(reduced), flown))
    again = read_table(path).measurements
    assert np.array_equal(again.blur_deg, m.blur_deg)
    assert again.u_random == pytest.approx(m.u_random)
