"""Drift of the lamp: interpolated between checks, extrapolated beyond, referred anew by a jump."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition.measure.drift import Drift, is_usable, rate
from instrument.record.reading import Check, Reading
from instrument.record.record import Record
from tests.support.scans import small_scan
from tests.support.whole_scans.stopped_scan import scan


def check(step: int, time_s: float, signal_dn: float, flags: str = "") -> Reading:
    """A drift check of 1 s exposure, its noise a thousandth of 1000 DN."""
    return Reading(
        step=step, kind="drift", surface="sample", theta_i_deg=30.0, dphi_deg=0.0,
        theta_r_deg=10.0, lamp_setting=0, block=0, signal_dn=signal_dn, u_noise_dn=1.0,
        u_quantisation_dn=0.0, u_dark_dn=0.0, u_placement_dn=0.0, u_texture_dn=0.0,
        exposure_s=1.0, frames=4, window_pixels=100.0, saturated_pixels=0, peak_dn=signal_dn,
        time_s=time_s, free_s=time_s, time_utc="", flags=flags,
    )  # fmt: skip


CHECKS = [check(0, 10.0, 1000.0), check(5, 20.0, 980.0), check(9, 40.0, 960.0)]
JUMP = Check(
    before_step=5, expected=1000.0, u_expected=1.0, jumped=True, reading=check(0, 12.0, 800.0)
)


def test_levels_are_interpolated_and_extrapolated_by_the_mean_trend() -> None:
    drift = Drift.of(CHECKS, 0)
    assert drift.level.tolist() == [1.0, 0.98, 0.96]
    assert drift.at(15.0) == pytest.approx(0.99)
    assert drift.at(30.0) == pytest.approx(0.97)
    # From first to last check the level falls by 0.04 in 30 s.
    assert drift.at(55.0) == pytest.approx(0.94)
    assert drift.u_extrapolated(30.0) == 0.0


@pytest.mark.parametrize("time_s", [-10.0, 5.0, 70.0, 100.0])
@pytest.mark.parametrize("bend", [0.0, 2e-6, -1e-5])
def test_the_uncertainty_of_an_extrapolation_is_what_a_changing_trend_leaves(
    bend: float, time_s: float
) -> None:
    def level(at_s: float) -> float:
        return 1 - 1e-4 * (at_s - 10) + bend * (at_s - 10) ** 2

    made = [check(n, t, 1000 * level(t)) for n, t in enumerate((10.0, 35.0, 60.0))]
    drift = Drift.of([replace(c, u_noise_dn=0.0) for c in made], 0)
    error = drift.at(time_s) - level(time_s)
    assert drift.u_extrapolated(time_s) == pytest.approx(abs(error), abs=1e-12)


def test_two_checks_leave_half_of_the_extrapolation_uncertain() -> None:
    drift = Drift.of(CHECKS[:2], 0)  # the level falls by 0.02 in 10 s
    assert drift.u_extrapolated(25.0) == pytest.approx(0.005)


def test_a_level_is_the_weighted_mean_of_its_two_checks() -> None:
    drift = Drift.of(CHECKS, 0)
    times_s = np.array([5.0, 10.0, 15.0, 20.0, 35.0, 50.0])
    before, weight = drift.interpolation(times_s)
    assert before.tolist() == [0, 0, 0, 1, 1, 2]
    assert weight == pytest.approx([0.0, 0.0, 0.5, 0.0, 0.75, 0.0])


def test_levels_after_a_jump_refer_to_the_first_check_of_all() -> None:
    drift = Drift.of([CHECKS[0], check(5, 20.0, 790.0), check(9, 40.0, 770.0)], 0, [JUMP])
    assert drift.level.tolist() == pytest.approx([1.0, 0.8, 0.79, 0.77])
    assert drift.at(11.0) == 1.0  # before the jump nothing is interpolated towards it
    assert drift.at(16.0) == pytest.approx(0.795)
    before, weight = drift.interpolation(np.array([11.0, 16.0]))
    assert (before.tolist(), weight.tolist()) == ([0, 1], [0.0, 0.5])


def test_a_check_is_predicted_with_its_noise_and_the_uncertainty_of_the_extrapolation() -> None:
    rate, u_relative = Drift.of(CHECKS, 0).predicted_rate(55.0)
    assert rate == pytest.approx(940.0)
    # At 20 s the level is 1/150 off the mean trend; 55 s is half a duration beyond the checks.
    bend, noise = 4 * (1 / 150 - 2 / 960) * 0.5 * 1.5, math.sqrt(2) / 960 * 0.5
    assert u_relative == pytest.approx(math.hypot(1 / 960, bend, noise))


def test_noise_of_the_checks_is_no_bend_of_the_drift() -> None:
    """A steady lamp seen with its noise: the extrapolation has the noise of the trend."""
    random = np.random.default_rng(1)
    pulls = []
    for _ in range(300):
        levels = 1000 + random.standard_normal(5)
        drift = Drift.of([check(n, 10.0 * n, level) for n, level in enumerate(levels)], 0)
        changed = drift.at(70.0) - drift.level[-1]  # by a trend that is noise alone
        pulls.append(changed / drift.u_extrapolated(70.0))
    assert 0.6 < np.sqrt(np.mean(np.square(pulls))) < 1.2


def test_without_usable_checks_the_level_is_1() -> None:
    drift = Drift.of([check(0, 10.0, 1000.0, "saturated"), check(5, 20.0, 9.0)], 0)
    assert drift.level.size == 0
    assert (drift.at(15.0), drift.u_extrapolated(15.0)) == (1.0, 0.0)


@pytest.mark.parametrize(
    ("signal_dn", "flags", "usable"), [(11, "", True), (9, "", False), (11, "saturated", False)]
)
def test_a_usable_check_has_no_flag_and_ten_u_of_signal(
    signal_dn: float, flags: str, usable: bool
) -> None:
    assert is_usable(check(0, 0.0, signal_dn, flags)) == usable


def test_levels_of_a_simulated_scan_are_those_at_its_checks(whole: list[Reading]) -> None:
    drifts = [r for r in whole if r.kind == "drift" and r.block == 0]
    assert len(drifts) > 2
    plain = Drift.of(whole, 0)
    assert plain.level[0] == 1.0
    assert plain.at(drifts[1].time_s) == pytest.approx(plain.level[1])
    before, weight = plain.interpolation(np.array([drifts[1].time_s]))
    assert (before.tolist(), weight.tolist()) == ([1], [0.0])


def test_levels_are_those_of_the_checks(tmp_path: Path) -> None:
    small = small_scan("paper_1995")  # a lamp set by hand: two blocks, each with its checks
    with Record.create(tmp_path / "run", {}) as record:
        scan(small, record, upto=4)
        scan(small, record)
        readings = record.readings()
    made = [r for r in readings if r.kind == "drift" and r.block == 1]
    drift = Drift.of(readings, 1)
    times_s = np.array([r.time_s for r in made])
    middle_s = (times_s[:-1] + times_s[1:]) / 2
    before, share = drift.interpolation(np.concatenate([times_s, middle_s]))
    assert before.tolist() == [0, 1, 2, 0, 1]
    assert share == pytest.approx([0, 0, 0, 0.5, 0.5])
    level = [rate(r) / rate(made[0]) for r in made]
    assert drift.at(float(middle_s[0])) == pytest.approx((level[0] + level[1]) / 2)


@pytest.mark.parametrize("seed", range(10))
def test_a_small_step_between_two_checks_is_within_three_u(seed: int) -> None:
    """A step that is no interlock, at a random moment of a random interval, in a drifting lamp."""
    random = np.random.default_rng(seed)
    times_s = 100.0 * np.arange(7) + random.uniform(0, 30, 7)
    trend, size = random.uniform(-0.02, 0.02) / 3600, random.choice([-1, 1]) * 0.02
    moment_s = random.uniform(times_s[0], times_s[-1])

    def level(at_s: np.ndarray) -> np.ndarray:
        return np.asarray(1 + trend * at_s + size * (at_s > moment_s))

    made = [check(n, float(t), 1000 * float(v)) for n, (t, v) in enumerate(
        zip(times_s, level(times_s), strict=True))]  # fmt: skip
    drift = Drift.of([replace(c, u_noise_dn=0.1) for c in made], 0)
    inside_s = np.linspace(times_s[0] + 0.1, times_s[-1], 200)
    error = np.array([drift.at(t) for t in inside_s]) * level(times_s[:1]) / level(inside_s) - 1
    assert np.max(np.abs(error)) > 0.005
    assert np.all(np.abs(error) <= 3 * drift.u_between(inside_s) + 1e-4)


@pytest.mark.parametrize("settling_s", [200.0, 600.0, 3000.0])
def test_a_lamp_that_warms_up_steadily_adds_no_uncertainty(settling_s: float) -> None:
    made = [check(n, 60.0 * n, 1000 * (1 - 0.005 * math.exp(-60.0 * n / settling_s)))
            for n in range(8)]  # fmt: skip
    assert not np.any(Drift.of(made, 0).u_between(np.linspace(0.0, 420.0, 50)))
