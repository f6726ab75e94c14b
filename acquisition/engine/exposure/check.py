"""Check of the camera's exposures by light, each when it is first used in a scan.

The counts of one scene at two exposures must be in the ratio of the exposures. The frames by which
the exposure is searched for serve where they can; else one frame at a shorter exposure is taken
first.
"""

from __future__ import annotations

import logging
import math
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

from acquisition.measure.linearity import LEAST_RATIO, NOTABLE_DEVIATION, Proportion, proportion
from acquisition.measure.radiometry import Dark
from acquisition.measure.window import Window
from acquisition.plan.exposure_ladder import longest_exposure_s
from instrument.clock import Clock
from instrument.config.camera import CameraConfig
from instrument.devices import Frame
from instrument.errors import WrongRigFile
from instrument.record.event_kinds import EXPOSURE
from instrument.record.record import Record

log = logging.getLogger(__name__)

ALLOWED_S, ALLOWED_EXPOSURES = 2.0, 2.0  # extra time a scan: 2 s and twice its longest exposure
_LONG_S = 0.1  # a longer exposure is compared with an eighth of it, a shorter one with a quarter
_GAMMAS = 1.5, 3.0  # of video and photography
_MAX_TRIES = 3  # of one exposure, in a scene too dark to prove anything


@dataclass(slots=True)
class ExposureCheck:
    """Exposures of a camera that light has confirmed, and the time spent on it.

    A resumed scan begins anew: the camera has been opened again. `now_s`: time without waiting for
    a lost camera. `confirmed`: exposures in seconds. `spent_s`:
    time of the extra frames.
    """

    camera: CameraConfig
    clock: Clock
    now_s: Callable[[], float]
    record: Record
    confirmed: set[float] = field(default_factory=set)
    spent_s: float = 0.0
    _longest_s: float = 0.0
    _tries: Counter[float] = field(default_factory=Counter)

    def comparison_s(self, exposure_s: float) -> float | None:
        """Return the shorter exposure with which to compare one, None if no frame is needed."""
        self._longest_s = max(self._longest_s, exposure_s)
        allowed_s = ALLOWED_S + ALLOWED_EXPOSURES * self._longest_s
        shorter_s = longest_exposure_s(exposure_s / (8 if exposure_s > _LONG_S else 4), self.camera)
        needed_s = 4 * (shorter_s + self.camera.frame_overhead_s)  # old frames are dropped first
        if (
            exposure_s in self.confirmed
            or self._tries[exposure_s] == _MAX_TRIES
            or exposure_s < LEAST_RATIO * shorter_s
            or self.spent_s + needed_s > allowed_s
        ):
            return None
        self._tries[exposure_s] += 1
        return shorter_s

    @contextmanager
    def timed(self) -> Iterator[None]:
        """Count the time of the block as spent on checks."""
        begun_s = self.now_s()
        yield
        self.spent_s += self.now_s() - begun_s

    def require_proportional(
        self,
        tried: Collection[Frame],
        frames: Sequence[Frame],
        darks: Mapping[float, Dark],
        window: Window,
    ) -> None:
        """Compare frames with those `tried` before at other exposures; the camera must agree.

        Raises `WrongRigFile` if the counts contradict the exposures. What was found is recorded.
        """
        exposure_s = frames[0].exposure_s
        if exposure_s in self.confirmed:
            return
        found = [proportion([one], frames, darks, window, self.camera) for one in tried]
        usable = [one for one in found if one is not None]
        for one in usable:
            if one.contradicts:
                raise _disbelief(one)
        best = min(usable, key=lambda one: one.u_relative, default=None)
        if best is not None and best.confirms:
            self.confirmed |= {best.shorter_s, best.longer_s}
            self.record.add_event(self.clock.utc().isoformat(), EXPOSURE, best.text())
            if best.deviation > NOTABLE_DEVIATION:
                text = "camera: %s: values measured at different exposures may differ by as much"
                log.warning(text, best.text())


def _disbelief(found: Proportion) -> WrongRigFile:
    return WrongRigFile(
        f"camera: {found.text()}: {_gamma_text(found)}it does not expose as long as it says "
        "(limited by its frame rate, in coarse steps, or automatic), or the lamp flickers; allow "
        "only exposures that it makes (min_exposure_s, max_exposure_s), or lower frames_per_s, in "
        "the rig file"
    )


def _gamma_text(found: Proportion) -> str:
    """Return the gamma that these counts would have, empty if no usual one."""
    gamma = math.log(found.expected) / math.log(max(found.ratio, 1.001))
    if not _GAMMAS[0] < gamma < _GAMMAS[1]:
        return ""
    return (
        f"as with a gamma of {gamma:.2g} that is left on: switch it off in the camera, or measure "
        "it (gonio calibrate camera) and name the file in the rig file (camera: calibration); or "
    )
