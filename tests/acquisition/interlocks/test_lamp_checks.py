"""Drift checks: a lamp that jumps or goes out ends the scan, one that warms up does not."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest

from acquisition.engine.resume import Progress
from acquisition.interlocks.lamp_checks import UNPROVEN, compared, doubtful_steps, failed
from acquisition.interlocks.references import References
from acquisition.plan.plan import make_plan
from acquisition.results.reduction import Reduced, reduce
from instrument.config.load import Loaded
from instrument.devices import Frame
from instrument.errors import DeviceError, Interlock, WrongRigFile
from instrument.record.reading import Check, Kind, Reading
from instrument.record.record import Record
from tests.support.scans import changed
from tests.support.stand_ins import PassThrough
from tests.support.whole_scans.lamp_faults import LampFault
from tests.support.whole_scans.stopped_scan import scan

NOISE = 2e-4  # relative, of one drift check


def reading(step: int, time_s: float, level: float, kind: Kind = "drift") -> Reading:
    """A reading of 1 s exposure and 1000 DN times the level."""
    return Reading(
        step=step, kind=kind, surface="sample", theta_i_deg=30.0, dphi_deg=0.0,
        theta_r_deg=10.0, lamp_setting=0, block=0, signal_dn=1000 * level,
        u_noise_dn=1000 * NOISE, u_quantisation_dn=0.0, u_dark_dn=0.0, u_placement_dn=0.0,
        u_texture_dn=0.0, exposure_s=1.0, frames=4, window_pixels=100.0, saturated_pixels=0,
        peak_dn=1000 * level, time_s=time_s, free_s=time_s, time_utc="", flags="",
    )  # fmt: skip


def outcomes(times_s: np.ndarray, levels: np.ndarray, seed: int = 0) -> list[bool]:
    """Whether each check fails, those before it having been accepted."""
    random, made, found = np.random.default_rng(seed), list[Reading](), list[bool]()
    for step, (time_s, level) in enumerate(zip(times_s, levels, strict=True)):
        noisy = float(level) + NOISE * float(random.standard_normal())
        made.append(reading(step, float(time_s), noisy))
        found.append(failed(compared(made[-1], made[:-1], (), step)))
    return found


@pytest.mark.parametrize("seed", range(15))
def test_a_lamp_that_warms_up_or_drifts_does_not_end_a_scan(seed: int) -> None:
    random = np.random.default_rng(seed)
    apart_s = random.uniform(20.0, 400.0)
    times_s = apart_s * (np.arange(12) + random.uniform(0.0, 0.3, 12))
    settling_s = random.uniform(300.0, 3000.0)
    largest = min(0.05, 0.015 * settling_s / apart_s)  # 1.5 % between the first two checks
    warming = 1 - random.uniform(-1, 1) * largest * np.exp(-times_s / settling_s)
    drifting = 1 + random.uniform(-1, 1) * min(0.5 / 3600, 0.015 / apart_s) * times_s
    assert not any(outcomes(times_s, warming, seed))
    assert not any(outcomes(times_s, drifting, seed))


@pytest.mark.parametrize("seed", range(15))
def test_a_jump_at_any_check_ends_a_scan(seed: int) -> None:
    random = np.random.default_rng(seed)
    times_s = random.uniform(20.0, 400.0) * np.arange(8)
    at, size = int(random.integers(1, 8)), random.choice([-1, 1]) * random.uniform(0.03, 0.5)
    drift = 1 + random.uniform(-0.02, 0.02) / 3600 * times_s
    found = outcomes(times_s, drift * (1 + size * (np.arange(8) >= at)), seed)
    assert found.index(True) == at


def test_readings_between_a_good_check_and_a_failed_one_are_doubtful() -> None:
    made = [reading(0, 0.0, 1.0), *(reading(n, 10.0 * n, 1.0, "point") for n in range(1, 4))]
    made += [reading(4, 40.0, 1.0), *(reading(n, 10.0 * n, 1.0, "point") for n in range(5, 8))]
    jump = Check(
        before_step=8, expected=1000.0, u_expected=1.0, jumped=True, reading=reading(8, 80.0, 0.9)
    )
    later = [reading(6, 90.0, 0.9, "point"), reading(8, 95.0, 0.9)]
    assert doubtful_steps(made, ()) == set()
    assert doubtful_steps(made, [jump]) == {5, 6, 7}
    # Measured again after the failed check, a point is as good as any.
    assert doubtful_steps([r for r in made if r.step != 6] + later, [jump]) == {5, 7}


def reduced(loaded: Loaded, record: Record) -> Reduced:
    return reduce(record.readings(), loaded.protocol, record.checks())


def drift_steps(loaded: Loaded) -> list[int]:
    return [step.index for step in make_plan(loaded).steps if step.kind == "drift"]


@pytest.mark.parametrize(("level", "which"), [(0.0, 1), (0.02, -1), (0.95, -1), (1.02, 1)])
def test_a_lamp_that_changes_in_mid_scan_stops_it_and_a_resume_makes_up_for_it(
    level: float,
    which: int,
    small: Loaded,
    whole: list[Reading],
    record: Record,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The lamp changes one point before the second drift check, or before the last one."""
    check = drift_steps(small)[which]
    fault = LampFault(at_step={check - 1: level}).install(monkeypatch)
    with pytest.raises(Interlock, match="drift check: drift reference"):
        scan(small, record)
    assert [r.step for r in record.readings()] == list(range(check))
    doubtful = Progress.of(record).doubtful
    assert check - 1 in doubtful
    assert not doubtful & set(range(drift_steps(small)[drift_steps(small).index(check) - 1]))
    found = reduced(small, record)
    assert {p.step for p, f in zip(found.points, found.flags, strict=True) if f} == doubtful
    assert {f for f in found.flags if f} <= {UNPROVEN, f"no signal; {UNPROVEN}"}
    fault.at_step = None
    scan(small, record)
    again, good = reduced(small, record), reduce(whole, small.protocol, ())
    assert not any(again.flags)
    assert not Progress.of(record).doubtful
    assert again.brdf == pytest.approx(good.brdf, rel=3e-3)


def test_a_lamp_that_stays_at_its_new_level_is_followed_from_there(
    small: Loaded, whole: list[Reading], record: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    fault = LampFault(at_step={drift_steps(small)[1] - 2: 0.8}).install(monkeypatch)
    with pytest.raises(Interlock):
        scan(small, record)
    fault.at_step, fault.level = None, 0.8
    scan(small, record)
    again, good = reduced(small, record), reduce(whole, small.protocol, ())
    assert not any(again.flags)
    assert again.brdf == pytest.approx(good.brdf, rel=3e-3)


def test_something_in_the_beam_during_one_check_costs_a_second_reading(
    small: Loaded, whole: list[Reading], record: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    fault = LampFault(at_step={drift_steps(small)[1]: 0.9}).install(monkeypatch)
    real = References.doubt

    def doubt(self: References, checked: Reading) -> str:
        found = real(self, checked)
        if found:
            fault.at_step = None  # it goes away
        return found

    monkeypatch.setattr(References, "doubt", doubt)
    scan(small, record)
    assert reduced(small, record).brdf == pytest.approx(
        reduce(whole, small.protocol, ()).brdf, rel=3e-3
    )
    assert not record.checks()


@pytest.mark.parametrize("upto", [3, 8])
def test_a_lamp_that_is_dead_at_a_resume_stops_it_again(
    upto: int, small: Loaded, whole: list[Reading], record: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    scan(small, record, upto)
    fault = LampFault(level=0.0).install(monkeypatch)
    with pytest.raises(Interlock):
        scan(small, record)
    assert len(record.readings()) == upto + 1
    fault.level = 1.0
    scan(small, record)
    assert reduced(small, record).brdf == pytest.approx(
        reduce(whole, small.protocol, ()).brdf, rel=3e-3
    )


def test_a_tile_read_before_a_failed_first_check_is_read_again(
    small: Loaded, whole: list[Reading], record: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The lamp goes out between tile and sample; the new one is 20 % darker."""
    fault = LampFault(at_step={drift_steps(small)[0]: 0.0}).install(monkeypatch)
    with pytest.raises(Interlock):
        scan(small, record)
    fault.at_step, fault.level = None, 0.8
    scan(small, record)
    assert reduced(small, record).brdf == pytest.approx(
        reduce(whole, small.protocol, ()).brdf, rel=3e-3
    )


def test_a_strong_linear_drift_is_followed(small: Loaded, record: Record) -> None:
    simulation = small.rig.simulation.model_copy(update={"lamp_drift_per_hour": -0.9})
    loaded = changed(small, rig={"simulation": simulation})
    scan(loaded, record)
    assert not any(reduced(loaded, record).flags)


@pytest.mark.parametrize("grab", [6, 7])
def test_light_that_changes_between_two_exposures_is_no_fault_of_the_rig_file(
    grab: int, small: Loaded, record: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While the exposures of the first drift check are compared and searched for."""
    fault = LampFault().install(monkeypatch)

    class Watched(PassThrough):
        calls = 0

        def grab(self, count: int) -> list[Frame]:
            self.calls += 1
            fault.level = 0.6 if self.calls >= grab else 1.0
            return self._device.grab(count)  # type: ignore[attr-defined,no-any-return]  # a camera

    with suppress(Interlock):
        scan(small, record, changed_devices=lambda d: replace(d, camera=Watched(d.camera)))  # type: ignore[arg-type]  # a stand-in


@pytest.mark.parametrize(("grab", "error"), [(33, WrongRigFile), (41, Interlock)])
def test_after_any_interlock_what_followed_the_last_drift_check_is_measured_again(
    grab: int, error: type[DeviceError], small: Loaded, whole: list[Reading], record: Record
) -> None:
    """The world may have been wrong before anything was seen of it."""

    class Watched(PassThrough):
        calls = 0

        def grab(self, count: int) -> list[Frame]:
            self.calls += 1
            if self.calls >= grab:
                raise error("frozen picture")
            return self._device.grab(count)  # type: ignore[attr-defined,no-any-return]  # a camera

    with pytest.raises(error):
        scan(small, record, changed_devices=lambda d: replace(d, camera=Watched(d.camera)))  # type: ignore[arg-type]  # a stand-in
    made = record.readings()
    last = max(r.step for r in made if r.kind == "drift")
    since = {r.step for r in made if r.step > last}
    found = reduced(small, record)
    assert {p.step for p, f in zip(found.points, found.flags, strict=True) if f} == since
    scan(small, record)
    again, good = reduced(small, record), reduce(whole, small.protocol, ())
    assert not any(again.flags)
    assert again.brdf == pytest.approx(good.brdf, rel=3e-3)
