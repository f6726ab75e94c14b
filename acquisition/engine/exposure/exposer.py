"""Exposure control: takes the frames of a step at a suitable exposure, and the darks for them."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from acquisition.engine.exposure.check import ExposureCheck
from acquisition.engine.exposure.search import ExposureSearch
from acquisition.engine.frame_files import write_dark
from acquisition.engine.retrying_camera import RetryingCamera
from acquisition.interlocks.darks import REFERENCE_FRAMES, DarkCheck, Excess
from acquisition.interlocks.doubt import doubt_text
from acquisition.interlocks.picture.outline_check import OutlineCheck
from acquisition.interlocks.picture.swap import SwapCheck
from acquisition.measure.hot_pixels import hot_pixel_text
from acquisition.measure.linearity import require_possible_times
from acquisition.measure.radiometry import Dark, average_dark
from acquisition.measure.window import Window
from acquisition.plan.exposure_ladder import longest_exposure_s
from acquisition.plan.plan import Step
from instrument.clock import Clock
from instrument.config.protocol import Protocol
from instrument.config.rig import Rig
from instrument.devices import Frame, Lamp, Surface
from instrument.errors import DeviceError, Interlock, WrongRigFile
from instrument.record.event_kinds import HOT, INTERLOCK, OPERATOR
from instrument.record.reading import Reading
from instrument.record.record import Record

log = logging.getLogger("acquisition.interlocks")

_MEASURED_AGAIN = (
    "Once that is in order, gonio resume goes on, and measures again what was measured since the "
    "last picture without this fault"
)
_LOOK_FOR_LIGHT = (
    "light reaches the camera although the lamp is darkened: look at its shutter or lid, and for "
    "light of the room"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Turn:
    """Turn of the axis during an exposure, and the u of the mean angle, all in degrees.

    `u_deg`: independent from frame to frame. `u_latency_deg`: signed, of an error that all share.
    """

    blur_deg: float = 0.0
    u_deg: float = 0.0
    u_latency_deg: float = 0.0


AT_REST = Turn()


@dataclass(frozen=True, slots=True)
class Exposed:
    """Frames of a step with their dark, ready to be reduced.

    `time_s`: scan time at the middle of the frames. `free_s`: that from which the rig may move.
    `turn`: of theta_r meanwhile; the step's pose is then the mean one.
    """

    step: Step
    frames: list[Frame]
    dark: Dark
    time_s: float
    free_s: float
    time_utc: str
    turn: Turn = AT_REST


@dataclass(slots=True)
class Exposer:
    """Chooses exposures, and takes and keeps one dark for each; every dark is recorded.

    An exposure that is used for the first time is checked by light. Where the camera rounds an
    exposure, the one that it confirmed counts. `on_pause` is called after an extra frame, whose
    time is no scan time.
    """

    camera: RetryingCamera
    lamp: Lamp
    clock: Clock
    protocol: Protocol
    rig: Rig
    record: Record
    on_pause: Callable[[], None]
    _check: ExposureCheck = field(init=False)
    _dark_check: DarkCheck = field(init=False)
    _start_s: float = field(default=0.0, init=False)
    _search: ExposureSearch = field(init=False)
    _darks: dict[float, Dark] = field(default_factory=dict, init=False)
    _used_before: frozenset[float] = field(default=frozenset(), init=False)
    _last: dict[Surface, Reading] = field(default_factory=dict, init=False)
    _outline: OutlineCheck = field(init=False)
    _swap: SwapCheck = field(init=False)
    set_s: float = field(default=0.0, init=False)  # exposure that was prepared last

    def __post_init__(self) -> None:
        target = self.protocol.exposure_target
        self._search = ExposureSearch(self.camera, self.rig.camera, target)
        self._dark_check = DarkCheck(self.rig)
        self._outline = OutlineCheck.of(self.rig, self.protocol)
        self._swap = SwapCheck(self.rig.camera)
        self._check = ExposureCheck(self.rig.camera, self.clock, self.running_s, self.record)

    def restore(self, readings: Sequence[Reading]) -> None:
        """Take over from a stopped scan: brightness of the surfaces, and exposures with a dark."""
        for reading in readings:
            self.note_brightness(reading)
        self._used_before = frozenset(reading.exposure_s for reading in readings)

    def note_brightness(self, reading: Reading) -> None:
        """Base the first exposure of the surface's next step on this reading."""
        self._last[reading.surface] = reading

    def start_clock(self, elapsed_s: float) -> None:
        """Start the scan time, at the duration so far."""
        self._start_s = self.running_s() - elapsed_s

    def expose(self, step: Step, window: Window) -> Exposed:
        """Take all frames of a step, unsaturated if the camera's exposure range allows it.

        Counts out of proportion to the exposures are taken again: the light may have changed. Only
        a camera that is confirmed by then is not at fault.
        """
        try:
            return self._expose(step, window)
        except WrongRigFile as error:
            log.warning("%s: measured again", error)
            exposed = self._expose(step, window)
            if exposed.frames[0].exposure_s not in self._check.confirmed:
                raise
            return exposed

    def _expose(self, step: Step, window: Window) -> Exposed:
        guess_s = self._first_guess_s(step)
        tried = self._comparison(guess_s) + self._search.frames(guess_s, window)
        first = self._at_its_place(tried.pop(), step)
        self._require_swapped(first, step)
        frames, first_s = [first], self.scan_s()
        if step.frames > 1:
            frames += self.camera.grab(step.frames - 1)
        require_possible_times(frames)
        time_s = round((first_s + self.scan_s() - first.exposure_s) / 2, 3)
        utc = self.clock.utc().isoformat()
        dark = self._dark(first.exposure_s, window)
        self._check.require_proportional(tried, frames, self._darks, window)
        return Exposed(step, frames, dark, time_s=time_s, free_s=self.scan_s(), time_utc=utc)

    def prepare(self, exposure_s: float, window: Window) -> float:
        """Set an exposure for frames of an axis that turns; return it as the camera took it.

        Its dark is taken now, if there is none: the rig stands.
        """
        asked_s = self._search.asked_s(exposure_s)
        self._search.set(asked_s)
        self._dark(self._search.taken_s[asked_s], window)
        self._search.set(asked_s)
        self.set_s = self._search.taken_s[asked_s]
        return self.set_s

    @property
    def target_dn(self) -> float:
        """Level above black that the brightest part of the window should reach."""
        camera = self.rig.camera
        return self.protocol.exposure_target * (camera.max_dn - camera.black_level_dn)

    def exposure_s(self, rate_dn_per_s: float) -> float:
        """Return the exposure, as it is asked for, at which a brightness reaches the target."""
        limit_s = self.target_dn / max(rate_dn_per_s, 1e-9)
        return longest_exposure_s(limit_s, self.rig.camera, self._search.taken_s)

    def dark(self, exposure_s: float) -> Dark:
        """Return the dark of an exposure that was prepared."""
        return self._darks[exposure_s]

    def contradiction(self, frame: Frame, step: Step) -> str:
        """Return how a frame contradicts the pose of a step; empty if it does not."""
        text = self._outline.contradiction(frame.image, step)
        self._swap.contradiction(frame, step)
        return f"{text}. {_MEASURED_AGAIN}" if text else ""

    def flown(self, step: Step, frame: Frame, turn: Turn) -> Exposed:
        """Return the frame of a step that was taken while the axis turned."""
        free_s = self.scan_s()
        time_s = round(free_s - frame.exposure_s / 2, 3)
        utc = self.clock.utc().isoformat()
        dark = self._darks[frame.exposure_s]
        return Exposed(step, [frame], dark, time_s, free_s, utc, turn)

    def _require_swapped(self, first: Frame, step: Step) -> None:
        """Raise `Interlock` if a reference shows the surface that should have been taken away."""
        text = self._swap.contradiction(first, step)
        if text:
            self._put_in_doubt(self._swap.doubted)
            raise Interlock(f"{text}. {_MEASURED_AGAIN}")

    def _at_its_place(self, first: Frame, step: Step) -> Frame:
        """Return a first frame that shows the surface where the pose puts it, or a second one."""
        text = self._outline.contradiction(first.image, step)
        if not text:
            return first
        second = self.camera.grab(1)[0]
        still = self._outline.contradiction(second.image, step)
        if still:
            self._put_in_doubt(self._outline.doubted)
            raise Interlock(f"{still}. Seen in two frames of step {step.index}. {_MEASURED_AGAIN}")
        log.warning("%s. A second frame shows it at its place, and counts", text)
        return second

    def _put_in_doubt(self, steps: Sequence[int]) -> None:
        if steps:
            text = doubt_text(steps, self.scan_s())
            self.record.add_event(self.clock.utc().isoformat(), INTERLOCK, text)

    def scan_s(self) -> float:
        """Return the scan time: seconds since its start, without interruptions."""
        return self.running_s() - self._start_s

    def running_s(self) -> float:
        """Return the time in seconds, without waiting for a lost camera and checking exposures."""
        return self.clock.now_s() - self.camera.waited_s - self._check.spent_s

    def _comparison(self, exposure_s: float) -> list[Frame]:
        """Take a frame of a shorter exposure, if the given one is to be checked."""
        shorter_s = self._check.comparison_s(self._search.taken_s.get(exposure_s, exposure_s))
        if shorter_s is None:
            return []
        with self._check.timed():
            self._search.set(shorter_s)
            frames = self.camera.grab(1)
        self.on_pause()
        return frames

    def _first_guess_s(self, step: Step) -> float:
        """Return the exposure that suits the surface's last reading, or else the planned one."""
        last = self._last.get(step.surface)
        if last is None or math.isnan(last.peak_dn):
            return step.expected_exposure_s
        return self._search.exposure_s(last.peak_dn, last.exposure_s)

    def _dark(self, exposure_s: float, window: Window) -> Dark:
        """Return the dark of an exposure; the scan time excludes darks repeated by a resume."""
        if exposure_s not in self._darks:
            begun_s = self.scan_s()
            asked_s = self._search.asked_s(exposure_s)
            self.take_darks((asked_s,), window)
            if exposure_s in self._used_before:
                self._start_s += self.scan_s() - begun_s
        if exposure_s not in self._darks:
            now_s = self._search.taken_s[asked_s]
            raise DeviceError(
                f"camera: {exposure_s:g} s cannot be set a second time: it now takes {now_s:g} s "
                f"where {asked_s:g} s is asked for; name exposures in the rig file "
                "(min_exposure_s) that it keeps"
            )
        return self._darks[exposure_s]

    def take_darks(self, exposures_s: Sequence[float], window: Window) -> None:
        """Darken the lamp, take the dark frames of these exposures, light it again.

        Raises `Interlock` if there is light in them, seen in the window, at a second attempt too.
        """
        if not exposures_s:
            return
        darks = self._without_light(exposures_s, window)
        if (found := _too_bright(darks)) is not None:
            log.warning("darks: %s: taken again", found.text())
            self._dark_check.forget_reference()
            darks = self._without_light(exposures_s, window)
            if (found := _too_bright(darks)) is not None:
                raise Interlock(f"darks: {found.text()}; {_LOOK_FOR_LIGHT}")
        for dark, found in darks:
            self._keep(dark, found)
        self.lamp.light()
        self._note_cover("lamp uncovered")

    def _without_light(
        self, exposures_s: Sequence[float], window: Window
    ) -> list[tuple[Dark, Excess]]:
        """Darken the lamp and return the darks of these exposures, with the light in them."""
        self.lamp.darken()
        self._note_cover("lamp covered for the darks")
        reference_s = self._dark_check.reference_s(exposures_s)
        if reference_s is not None:
            begun_s = self.running_s()
            self._dark_check.set_reference([self._grab_dark(reference_s, REFERENCE_FRAMES)])
            self._start_s += self.running_s() - begun_s  # no scan time
        darks = [self._grab_dark(e, self.protocol.dark_frames) for e in exposures_s]
        self._dark_check.set_reference(darks)
        return [(dark, self._dark_check.excess(dark, window)) for dark in darks]

    def _grab_dark(self, exposure_s: float, count: int) -> Dark:
        self._search.set(exposure_s)
        frames = self.camera.grab(count)
        require_possible_times(frames)
        return average_dark(frames, self.rig.camera)

    def _keep(self, dark: Dark, found: Excess) -> None:
        """Record a dark, and use it from now on."""
        if found.light_dn > 0:
            log.warning("darks: %s: subtracted, and taken as uncertain", found.text())
        self._darks[dark.exposure_s] = replace(dark, light_dn=found.light_dn)
        if self.protocol.keep_frames:
            write_dark(dark, self.record.folder)
        mean, noise = float(dark.mean.mean()), float(np.sqrt(dark.variance.mean()))
        time_utc = self.clock.utc().isoformat()
        self.record.add_dark(time_utc, dark.exposure_s, dark.frames, mean, noise)
        if dark.hot is not None:
            self.record.add_event(time_utc, HOT, hot_pixel_text(dark.exposure_s, dark.hot))

    def _note_cover(self, text: str) -> None:
        if self.rig.lamp.darkened_by == "hand":
            self.record.add_event(self.clock.utc().isoformat(), OPERATOR, text)


def _too_bright(darks: Sequence[tuple[Dark, Excess]]) -> Excess | None:
    """Return the excess of the first dark that cannot be used, None if all can be."""
    return next((found for _, found in darks if found.is_too_much), None)
