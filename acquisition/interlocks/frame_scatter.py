"""Scatter of the window's mean from frame to frame, beyond what photons and read-out explain.

Only pixel noise, flicker of the lamp and the camera's black level make frames of one step differ.
With frame means m_k of variance v the sum of (m_k - mean)^2 / v has a chi-squared distribution of
n - 1 degrees of freedom; v is the larger of the rig file's photon transfer and the variance that
the pixels show (the true gain may differ from the full well of the rig file). What exceeds it
raises the noise of this and of later readings, up to what the rig file states for flicker and black
level; what exceeds that too is flagged, and ends the scan where reading after reading has it.

All readings of a scan so far tell the flicker. A few tell it badly: two frames agree by chance, the
reading then counts for more than it is worth, and a fit follows it. Each reading therefore keeps
its scatter, and once the scan is reduced, all of them tell the flicker of each (`flicker_share`).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from acquisition.measure.hot_pixels import without_hot_pixels
from acquisition.measure.radiometry import Dark, Signal, photon_transfer
from acquisition.measure.type_a import SEEN_SIGMA, chi_squared_limit
from acquisition.measure.window import Window
from instrument.config.rig import Rig
from instrument.devices import Frame
from instrument.errors import Interlock
from instrument.geometry import FloatArray
from instrument.record.reading import Reading

FLAG = "frames differ"
# Limit of chi-squared, as a deviation of a normal distribution: a scatter that is surely too large
# is seen in none of 50 million sound readings. SEEN_SIGMA is the one that raises u.
_SURE_SIGMA = 5.5
_LOW_TAIL = 0.16  # probability that so small a scatter is seen by chance: one standard deviation
RECENT = 8
"""Last readings that tell a flicker that comes and goes."""
# Variance of a pixel relative to the rig file's: 16 of read noise where the true full well is a
# quarter. More is no noise, but a frame that differs.
_MOST_NOISE = 20.0
_LEAST_VARIANCE = 1e-12  # in DN^2


@dataclass(frozen=True, slots=True)
class Scatter:
    """Scatter of frame means in one reading, in DN^2.

    freedom: degrees of freedom. squares: sum of the squared deviations of each frame's mean from
    the mean of all. pixel_variance: of one frame's mean by pixel noise. allowed_variance: by
    flicker and black level.
    """

    freedom: int
    squares: float
    pixel_variance: float
    allowed_variance: float

    @property
    def standard_deviation(self) -> float:
        """Standard deviation of a frame's mean, in DN; 0 for a single frame."""
        return math.sqrt(self.squares / max(self.freedom, 1))

    @property
    def noise_ratio(self) -> float:
        """Sum of squares relative to the variance by pixel noise: chi-squared."""
        return self.squares / self.pixel_variance

    @property
    def ratio(self) -> float:
        """Sum of squares relative to the variance that noise and rig file allow: chi-squared."""
        return self.squares / (self.pixel_variance + self.allowed_variance)

    @property
    def mean_ratio(self) -> float:
        """Ratio to the allowed variance per degree of freedom: the larger, the worse."""
        return self.ratio / max(self.freedom, 1)

    @property
    def differs(self) -> bool:
        """True for a reading to flag: its frames surely differ by more than is allowed."""
        return self.ratio > chi_squared_limit(self.freedom, _SURE_SIGMA)

    def surely_exceeds(self, share: float) -> bool:
        """Return whether a share, 0 to 1, of what is allowed surely leaves some unexplained."""
        return self.explained(share).noise_ratio > chi_squared_limit(self.freedom, SEEN_SIGMA)

    def explained(self, share: float) -> Scatter:
        """Return a copy in which a share, 0 to 1, of what is allowed counts as pixel noise."""
        variance = self.pixel_variance + share * self.allowed_variance
        return replace(self, pixel_variance=variance)


@dataclass(slots=True)
class _Sums:
    """Sums over readings, in DN^2 where they are no numbers; variances by degrees of freedom."""

    freedom: int = 0
    noise_ratio: float = 0.0
    squares: float = 0.0
    pixel_variance: float = 0.0
    allowed_variance: float = 0.0

    @classmethod
    def of(cls, readings: Iterable[Scatter]) -> _Sums:
        """Return the sums over these readings."""
        sums = cls()
        for one in readings:
            sums.add(one)
        return sums

    def add(self, one: Scatter) -> None:
        """Count one more reading."""
        self.freedom += one.freedom
        self.noise_ratio += one.noise_ratio
        self.squares += one.squares
        self.pixel_variance += one.freedom * one.pixel_variance
        self.allowed_variance += one.freedom * one.allowed_variance

    @property
    def share(self) -> float:
        """84 % bound of what is seen beyond pixel noise, as a share, 0 to 1, of what is allowed.

        A bound, as two frames alone may agree by chance; the more readings, the closer it is.
        """
        return self._share_of(self._bound) if self._seen else 0.0

    @property
    def mean_share(self) -> float:
        """What is seen beyond pixel noise, as a share, 0 to 1, of what is allowed.

        Its variance is known by so many degrees of freedom, so it counts as that of Student's t
        (JCGM 101:2008, 6.4.9.4); with few of them the bound is the smaller value.
        """
        if not self._seen:
            return 0.0
        spare = self.freedom - 2
        factor = self.freedom / spare if spare > 0 else math.inf
        return self._share_of(min(self._bound, factor * self.squares))

    @property
    def _seen(self) -> bool:
        return self.noise_ratio > chi_squared_limit(self.freedom, SEEN_SIGMA)

    @property
    def _bound(self) -> float:
        from scipy.special import chdtri  # heavy: no quiet scan needs it

        return self.squares * self.freedom / float(chdtri(self.freedom, 1 - _LOW_TAIL))

    def _share_of(self, squares: float) -> float:
        excess = max(squares - self.pixel_variance, 0.0)
        return 1.0 if excess >= self.allowed_variance else excess / self.allowed_variance


def flicker_share(readings: Iterable[Scatter]) -> float:
    """Return the share, 0 to 1, of the allowed variance that all readings of a scan show.

    Readings whose frames differ do not count, nor does the worst of the others where it surely
    scatters by more than those.
    """
    several = _by_scatter(readings)
    sums = _Sums.of(several[:-1])
    for worst in several[-1:]:
        if not worst.surely_exceeds(sums.share):
            sums.add(worst)
    return sums.mean_share


def surely_more(own: Scatter, around: Iterable[Scatter], share: float) -> bool:
    """Return whether a reading, or those around it, surely scatter by more than a share explains.

    The share, 0 to 1, is of the allowed variance. The worst of those around stands by itself.
    """
    others = _by_scatter(around)[:-1]
    return own.surely_exceeds(share) or _Sums.of(one.explained(share) for one in others).share > 0


def _by_scatter(readings: Iterable[Scatter]) -> list[Scatter]:
    """Return the readings of several frames that do not differ too much, the worst last."""
    several = [one for one in readings if one.freedom and not one.differs]
    return sorted(several, key=lambda one: one.mean_ratio)


def scatter_of(reading: Reading, rig: Rig) -> Scatter:
    """Return the scatter of a reading as the record keeps it."""
    freedom = max(reading.frames - 1, 0)
    flicker_dn, black_dn = rig.lamp.u_flicker * reading.signal_dn, rig.camera.u_black_level_dn
    return Scatter(
        freedom=freedom,
        squares=freedom * reading.scatter_dn**2,
        pixel_variance=max(reading.frames * reading.u_pixel_dn**2, _LEAST_VARIANCE),
        allowed_variance=flicker_dn**2 + black_dn**2,
    )


def _frame_scatter(
    deviations_dn: FloatArray, frames: int, signal: Signal, window: Window, rig: Rig
) -> Scatter:
    """Return the scatter of the window's mean; a single frame has none, and no freedom."""
    total, squares = float(window.weights.sum()), float(np.vdot(window.weights, window.weights))
    level_dn = rig.camera.black_level_dn + max(signal.signal_dn, 0.0) / total
    predicted = squares * float(photon_transfer(np.asarray(level_dn), rig.camera))
    shown = min(frames * signal.u_noise_dn**2, _MOST_NOISE * predicted)
    flicker_dn = rig.lamp.u_flicker * signal.signal_dn
    black_dn = rig.camera.u_black_level_dn * total
    return Scatter(
        freedom=frames - 1,
        squares=float(deviations_dn @ deviations_dn),
        pixel_variance=max(predicted, shown, _LEAST_VARIANCE),
        allowed_variance=flicker_dn**2 + black_dn**2,
    )


def _deviations_dn(frames: Sequence[Frame], window: Window) -> FloatArray:
    """Return the deviation of each frame's window mean from the mean of all, (frames,) in DN."""
    if len(frames) == 1:
        return np.zeros(1)
    first = frames[0].image[window.crop].astype(np.float32)
    weights = window.weights.astype(np.float32)
    means, change = [0.0], np.empty_like(first)
    for frame in frames[1:]:  # differences of counts are exact in single precision
        np.subtract(frame.image[window.crop], first, out=change)
        means.append(float(np.vdot(weights, change)))
    deviations: FloatArray = np.array(means) - np.mean(means)
    return deviations


@dataclass(slots=True)
class FrameScatter:
    """Judge of the readings of one scan; `note` records what was found.

    A single bad frame spoils one reading; a reading of one frame has the flicker of the others.
    Where the last readings without the worst of them scatter too much all together, the lamp or the
    camera is unsteady.
    """

    rig: Rig
    note: Callable[[str], None]
    _recent: deque[Scatter] = field(default_factory=lambda: deque(maxlen=RECENT))
    # All readings that were not flagged; the worst of them stands by itself.
    _so_far: _Sums = field(default_factory=_Sums)
    _worst: Scatter | None = None
    # Deviation of each frame's mean in the last reading of several frames, for messages.
    _last_dn: FloatArray = field(default_factory=lambda: np.zeros(1))

    def judged(
        self, signal: Signal, frames: Sequence[Frame], dark: Dark, window: Window, name: str
    ) -> Signal:
        """Return the signal with the scatter in its noise, or flagged; `name` is its reading's.

        Raises `Interlock` where it is not the first such reading.
        """
        if not signal.window_pixels > 0:
            return signal
        window, _ = without_hot_pixels(window, dark.hot)
        deviations_dn = _deviations_dn(frames, window)
        found = _frame_scatter(deviations_dn, len(frames), signal, window, self.rig)
        u_pixel_dn = math.sqrt(found.pixel_variance / len(frames))
        signal = replace(signal, u_pixel_dn=u_pixel_dn, scatter_dn=found.standard_deviation)
        if found.freedom:
            self._last_dn = deviations_dn
            self._remember(found)
        if not self._recent:
            return signal
        excess = self._excess_variance(found) / len(frames)
        if excess > 0:
            signal = replace(signal, u_noise_dn=math.hypot(signal.u_noise_dn, math.sqrt(excess)))
        flags = [signal.flags] * bool(signal.flags)
        if found.differs:
            self.note(f"{name}: {FLAG}: {self._text(found, signal)}")
            flags.append(FLAG)
        self._require_steady(signal, name)
        return replace(signal, flags="; ".join(flags))

    def _without_worst(self) -> list[Scatter]:
        """Return the last readings, the worst left out if there are others."""
        order = sorted(self._recent, key=lambda one: one.mean_ratio)
        return order[:-1] or order

    def _remember(self, found: Scatter) -> None:
        """Count a reading of several frames, among all of the scan if it is not to be flagged."""
        self._recent.append(found)
        if found.differs:
            return
        worst = self._worst
        if worst is None or found.mean_ratio > worst.mean_ratio:
            self._worst, found = found, worst or found
        if worst is not None:
            self._so_far.add(found)

    def _excess_variance(self, found: Scatter) -> float:
        """Return the variance of one frame's mean beyond pixel noise, 0 if none is seen.

        The readings of the scan so far tell it, without the worst. The last ones count beside them
        if they scatter surely more, and the reading itself if it does.
        """
        known = self._so_far.share
        known += _Sums.of(one.explained(known) for one in self._without_worst()).share
        variance = min(known, 1.0) * found.allowed_variance
        rest = found.explained(min(known, 1.0))
        if rest.surely_exceeds(0.0):
            return max(found.squares / found.freedom - found.pixel_variance, variance)
        return variance

    def _require_steady(self, signal: Signal, name: str) -> None:
        """Raise `Interlock` if the last readings scatter too much, the worst left out."""
        last = self._without_worst()
        freedom = sum(one.freedom for one in last)
        if len(self._recent) < 2 or sum(one.ratio for one in last) <= chi_squared_limit(
            freedom, _SURE_SIGMA
        ):
            return
        raise Interlock(
            f"{FLAG}, in reading after reading, lastly in {name}: "
            f"{self._text(self._recent[-1], signal)}: look at the lamp's supply, at daylight and "
            "at the camera's cable; expose over whole periods of the mains; a lamp that flickers "
            "so much by nature needs a larger u_flicker in the rig file, and a new run"
        )

    def _text(self, found: Scatter, signal: Signal) -> str:
        worst = int(np.argmax(np.abs(self._last_dn)))
        return (
            f"the window's mean scatters by {found.standard_deviation:.3g} DN of "
            f"{signal.signal_dn:.4g} DN from frame to frame, most in frame {worst + 1} of "
            f"{self._last_dn.size} ({self._last_dn[worst]:+.3g} DN); noise explains "
            f"{math.sqrt(found.pixel_variance):.2g} DN, the rig file allows "
            f"{math.sqrt(found.allowed_variance):.2g} DN (lamp: u_flicker "
            f"{self.rig.lamp.u_flicker:g}, camera: u_black_level_dn "
            f"{self.rig.camera.u_black_level_dn:g})"
        )
