"""Measurement of a lamp: the tile's light over time, until it is steady, and a picture of it.

Nothing moves. Each reading is checked at once, so that a lamp that fails ends the watch.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from acquisition.calibration.exposure_search import exposure_reaching, share_of_scale
from acquisition.calibration.frame_statistics import Level, level_of, series_in_order, stack_of
from acquisition.calibration.lamp import checks
from acquisition.calibration.lamp.plan import PICTURE_FRAMES, TARGET, LampPlan
from acquisition.terminal.console import duration_text
from acquisition.terminal.live_line import live_line
from analysis.calibration.lamp_drift import DriftFit, fit_drift
from analysis.calibration.level_series import Estimate, LevelSeries, flicker
from analysis.calibration.pixel_maps import Stack
from instrument.clock import Clock
from instrument.devices import Camera, Frame, Lamp, Operator, Request
from instrument.geometry import BoolArray, FloatArray

COVERAGE = 3.0  # times u: a lamp is called steady only if so much more would still be


@dataclass(frozen=True, slots=True, kw_only=True)
class Readings:
    """Readings of the window in the order of time: lit, and dark before and after."""

    lit: LevelSeries
    dark: LevelSeries

    def signal_dn(self) -> FloatArray:
        """Return the signal of each reading (n,) in DN; the dark changes evenly with time."""
        return signal_of(self.lit, self.dark)

    def u_signal_dn(self) -> FloatArray:
        """Return the u of each signal (n,) in DN: photons, rounding, black level, flicker."""
        relative, wander = flicker(self.lit, self.dark)
        own = wander**2 + (relative * self.signal_dn()) ** 2
        return np.asarray(np.sqrt(self.lit.u_mean_dn() ** 2 + own / self.lit.frames))

    def u_black_dn(self) -> float:
        """Return the u of the change of the black level, in DN, from before to after.

        Rounding is the same in both, as long as their means are.
        """
        _, wander = flicker(self.lit, self.dark)
        each2 = (self.dark.variance_dn2 / self.dark.pixels + wander**2) / self.dark.frames
        return float(np.sqrt(np.sum(each2) + np.ptp(self.dark.mean_dn) ** 2 / 12))

    def fit(self) -> DriftFit:
        """Return the drift of the lamp."""
        u_black = self.u_black_dn() if self.dark.mean_dn.size > 1 else 0.0
        return fit_drift(self.lit.age_s, self.signal_dn(), self.u_signal_dn(), u_black)


@dataclass(frozen=True, slots=True, kw_only=True)
class Watched:
    """Measurement of a lamp: readings of the window, and pictures of the tile, lit and dark."""

    readings: Readings
    picture: Stack
    dark_picture: Stack


@dataclass(slots=True, kw_only=True)
class LampWatcher:
    """Devices of a rig at work on a plan; `say` tells the operator what is going on."""

    plan: LampPlan
    camera: Camera
    lamp: Lamp
    operator: Operator
    clock: Clock
    say: Callable[[str], None]

    def measure(self) -> Watched:
        """Watch the lamp and take the pictures; the lamp is left lit."""
        self.operator.ask(Request("place", self._place(), surface="sample"))
        patch = self.plan.patch()
        exposure_s = self._set_exposure(patch)
        before = self._darks()
        self.lamp.light()
        start_s, linear = self.clock.now_s(), self.plan.rig.camera.linear_dn
        dark = [level_of(before, patch, start_s, linear)]
        lit = self._watch(patch, start_s, series_in_time(dark, patch))
        self.say(f"uniformity: {PICTURE_FRAMES} frames at {exposure_s:g} s")
        picture = stack_of(self.camera.grab(PICTURE_FRAMES), linear)
        after = self._darks()
        self.lamp.light()
        dark.append(level_of(after, patch, start_s, linear))
        readings = Readings(lit=lit, dark=series_in_time(dark, patch))
        return Watched(
            readings=readings, picture=picture, dark_picture=stack_of([*before, *after], linear)
        )

    def _place(self) -> str:
        plan = self.plan
        return (
            f"Place the white tile with its middle on the axis, lamp at theta_i "
            f"{plan.theta_i_deg:g} and dphi 0 deg, camera at theta_r {plan.theta_r_deg:g} deg, "
            "automatic exposure and gain off. Switch the lamp on now, if its warm-up is asked for"
        )

    def _set_exposure(self, patch: BoolArray) -> float:
        """Set an exposure, in s, that leaves room for a lamp that grows brighter; return it."""
        camera = self.plan.rig.camera

        def share(exposure_s: float) -> float:
            self.camera.set_exposure_s(exposure_s)
            return share_of_scale(float(np.mean(self.camera.grab(1)[0].image[patch])), camera)

        return self.camera.set_exposure_s(exposure_reaching(TARGET, share, camera))

    def _darks(self) -> list[Frame]:
        self.say(f"darks: {PICTURE_FRAMES} frames")
        self.lamp.darken()
        return self.camera.grab(PICTURE_FRAMES)

    def _watch(self, patch: BoolArray, start_s: float, dark: LevelSeries) -> LevelSeries:
        """Take readings until the lamp is steady, or the time is over."""
        plan, levels, number = self.plan, list[Level](), 0
        with live_line("the lamp's light") as show:
            while True:
                frames = self.camera.grab(plan.frames)
                checks.require_unsaturated(frames, patch, plan.rig.camera)
                levels.append(level_of(frames, patch, start_s, plan.rig.camera.linear_dn))
                if len(levels) == 1:
                    light, exposure_s = levels[0][1], frames[0].exposure_s
                    base = float(dark.mean_dn[0])
                    checks.require_light(light, base, exposure_s, plan.rig.camera)
                lit = series_in_time(levels, patch)
                checks.require_lamp(lit, signal_of(lit, dark))
                if self._is_enough(lit, dark, show):
                    return lit
                number += 1
                due_s = start_s + number * plan.every_s
                if due_s - start_s > 60 * plan.minutes:
                    return lit
                self.clock.sleep(max(due_s - self.clock.now_s(), 0.0))

    def _is_enough(self, lit: LevelSeries, dark: LevelSeries, show: Callable[[str], None]) -> bool:
        """Show how the light changes; return True if it is steady."""
        if lit.age_s.size < 3:
            return False
        fit = Readings(lit=lit, dark=dark).fit()
        age_s = float(lit.age_s[-1])
        change = fit.change(age_s, self.plan.within_s)
        show(watch_text(self.plan, age_s, change))
        return age_s >= self.plan.shortest_s and is_steady(change, self.plan)


def watch_text(plan: LampPlan, age_s: float, change: Estimate) -> str:
    """Return the line that is shown after a reading."""
    return (
        f"{duration_text(age_s)}: the light changes by {100 * change.value:+.2g} % "
        f"(u {100 * change.u:.1g} %) within {plan.within_minutes:g} min; steady below "
        f"{plan.limit_percent:g} %"
    )


def is_steady(change: Estimate, plan: LampPlan) -> bool:
    """Return True if a change, with its u, is below the plan's limit."""
    return abs(change.value) + COVERAGE * change.u < plan.limit


def signal_of(lit: LevelSeries, dark: LevelSeries) -> FloatArray:
    """Return lit levels (n,) in DN less the dark level, interpolated in time."""
    return np.asarray(lit.mean_dn - np.interp(lit.age_s, dark.age_s, dark.mean_dn))


def series_in_time(levels: list[Level], patch: BoolArray) -> LevelSeries:
    """Return levels of one exposure, rows in DN and s, in the order of time.

    patch: (rows, columns), True for the pixels of the window.
    """
    return series_in_order(levels, int(np.count_nonzero(patch)))
