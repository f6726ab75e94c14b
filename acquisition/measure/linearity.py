"""Proportionality of counts to exposure, and frames that are closer together than their exposure.

A camera may report an exposure that it does not make: a USB camera's control is answered from a
cache, and a sensor cannot expose longer than its frame period. Two exposures of one scene show it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.measure.placement import Placement
from acquisition.measure.radiometry import SATURATION_FRACTION, Dark, Signal, measure
from acquisition.measure.window import Window
from instrument.config.camera import CameraConfig
from instrument.devices import Frame
from instrument.errors import WrongRigFile

LARGEST_DEVIATION = 0.02  # of the ratio of counts from that of exposures, beyond 4 u
NOTABLE_DEVIATION = 0.005  # of the same ratio, beyond 4 u
LARGEST_U = 0.01  # relative: a ratio less certain than this proves nothing
LEAST_RATIO = 1.3  # of two exposures: closer ones would agree whatever the camera did
_COVERAGE = 4.0
# The arrival of a frame at a computer varies by a few ms (USB); it is averaged over the series.
_JITTER_S, _SHARE = 0.002, 0.95
_ON_AXIS = Placement(0.0, 0.0, 1.0)  # without an effect on the mean


@dataclass(frozen=True, slots=True, kw_only=True)
class Proportion:
    """Comparison of the window's counts at two exposures, both in seconds.

    ratio: counts at the longer exposure over those at the shorter one, dark subtracted; u_relative:
    its relative standard uncertainty.
    """

    shorter_s: float
    longer_s: float
    ratio: float
    u_relative: float

    @property
    def expected(self) -> float:
        """Ratio of the exposures."""
        return self.longer_s / self.shorter_s

    @property
    def deviation(self) -> float:
        """Relative deviation of the ratio of counts from that of exposures, 4 u taken off."""
        return max(abs(self.ratio / self.expected - 1) - _COVERAGE * self.u_relative, 0.0)

    @property
    def contradicts(self) -> bool:
        """True if the counts cannot be those of these exposures."""
        return self.deviation > LARGEST_DEVIATION

    @property
    def confirms(self) -> bool:
        """True if the counts agree with the exposures and are certain enough to prove it."""
        return not self.contradicts and self.u_relative <= LARGEST_U

    def text(self) -> str:
        """Return the comparison in words."""
        return (
            f"counts at {self.longer_s:g} s are {self.ratio:.4g} times those at "
            f"{self.shorter_s:g} s ({self.expected:.4g} expected, u {self.u_relative:.2g} relative)"
        )


def proportion(
    one: Sequence[Frame],
    other: Sequence[Frame],
    darks: Mapping[float, Dark],
    window: Window,
    camera: CameraConfig,
) -> Proportion | None:
    """Compare frames of one scene at two exposures; None if they cannot be compared.

    They must not be saturated, the exposures must differ, and `darks`, by exposure in seconds, must
    hold at least one of the two.
    """
    shorter, longer = sorted((one, other), key=lambda frames: frames[0].exposure_s)
    shorter_s, longer_s = shorter[0].exposure_s, longer[0].exposure_s
    if longer_s < LEAST_RATIO * shorter_s or not window.pixels:
        return None
    signals, u = [], 0.0
    for frames in (longer, shorter):
        dark, u_dark = dark_at(frames[0].exposure_s, darks, camera)
        signal = measure(frames, dark, window, camera, _ON_AXIS, 0)
        if signal.peak_dn >= SATURATION_FRACTION * camera.max_dn or signal.signal_dn <= 0:
            return None
        u = float(np.hypot(u, _u(signal, u_dark * float(window.weights.sum())) / signal.signal_dn))
        signals.append(signal.signal_dn)
    u = float(np.hypot(u, max(_scatter(frames, window) for frames in (longer, shorter))))
    return Proportion(
        shorter_s=shorter_s, longer_s=longer_s, ratio=signals[0] / signals[1], u_relative=u
    )


def _u(signal: Signal, u_dark_dn: float) -> float:
    """Return the standard uncertainty of a signal in DN; that of an estimated dark is added."""
    own = (signal.u_noise_dn, signal.u_quantisation_dn, signal.u_dark_dn, u_dark_dn)
    return float(np.linalg.norm(own))


def _scatter(frames: Sequence[Frame], window: Window) -> float:
    """Return the relative scatter of the window's mean from frame to frame: the lamp's flicker."""
    means = [window.mean(frame.image[window.crop].astype(np.float64)) for frame in frames]
    return float(np.std(means, ddof=1) / np.mean(means)) if len(means) > 1 else 0.0


def dark_at(
    exposure_s: float, darks: Mapping[float, Dark], camera: CameraConfig
) -> tuple[Dark, float]:
    """Return the dark of an exposure, measured or estimated, and the estimate's u in DN.

    Estimated on a straight line through the two darks of the nearest exposures; with only one, on
    the line to the rig file's black level, whose error may be as large as the difference.
    """
    if exposure_s in darks:
        return darks[exposure_s], 0.0
    near = sorted(darks.values(), key=lambda dark: abs(dark.exposure_s - exposure_s))[:2]
    known = near[0]
    if len(near) > 1:
        per_s = (near[1].mean - known.mean) / (near[1].exposure_s - known.exposure_s)
        mean, u = known.mean + per_s * (exposure_s - known.exposure_s), 0.0
    else:
        above = known.mean - camera.black_level_dn
        mean = camera.black_level_dn + above * (exposure_s / known.exposure_s)
        u = abs(float(above.mean())) / 2
    light_dn = max(dark.light_dn for dark in near)
    return Dark(exposure_s, mean, known.variance, known.frames, known.hot, light_dn), u


def require_possible_times(frames: Sequence[Frame]) -> None:
    """Raise `WrongRigFile` if frames of one exposure follow one another faster than they can.

    A pixel cannot be exposed twice at a time. Frames without a time stamp prove nothing.
    """
    stamps = [frame.device_time_s for frame in frames if frame.device_time_s is not None]
    if len(stamps) < 2 or len(stamps) < len(frames):
        return
    gaps, exposure_s = len(stamps) - 1, min(frame.exposure_s for frame in frames)
    period_s = (stamps[-1] - stamps[0]) / gaps
    if period_s < _SHARE * exposure_s - _JITTER_S / gaps:
        raise WrongRigFile(
            f"camera: its frames come every {period_s:.3g} s, but each is said to be exposed for "
            f"{exposure_s:g} s: it does not expose longer than its frame period; lower "
            f"max_exposure_s to {period_s:.3g} s, or frames_per_s, in the rig file"
        )
