"""Frozen picture: a camera that delivers a frame once more.

No two frames of a live sensor are equal: photons and read-out change some pixels. A quiet 8-bit
sensor in the dark may repeat itself, and so may a saturated one; the photon transfer of the rig
file decides.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.measure.radiometry import photon_transfer
from instrument.config.camera import CameraConfig
from instrument.devices import Frame, Image
from instrument.errors import Interlock

_SAMPLED = 4096  # pixels of a frame, over all of it
# Expected number of sampled pixels that differ; that none does has a probability below exp(-40).
_LEAST_DIFFERING = 40.0
_CAUTION = 0.5  # of the rig file's noise: with a full well of a quarter the noise is half


@dataclass(slots=True)
class FrozenPicture:
    """Comparison of each frame with the others of its series and of the series before.

    A driver that hands out a few buffers over and over repeats a whole series.
    """

    camera: CameraConfig
    _previous: set[bytes] = field(default_factory=set)

    def require_live(self, frames: Sequence[Frame]) -> None:
        """Raise `Interlock` if a frame equals an earlier one although its noise forbids it."""
        own: set[bytes] = set()
        for number, frame in enumerate(frames, 1):
            sample = _sample(frame.image)
            key = sample.tobytes()
            if key in own or key in self._previous:
                self._require_quiet(sample, number, len(frames))
            own.add(key)
        self._previous = own

    def _require_quiet(self, sample: NDArray[Any], number: int, count: int) -> None:
        expected = differing_pixels(sample, self.camera)
        if expected < _LEAST_DIFFERING:
            return
        raise Interlock(
            f"frozen picture: frame {number} of {count} equals an earlier frame in all "
            f"{sample.size} pixels compared, of which {expected:.0f} or more must differ by the "
            "rig file's photon and read noise: the camera or its driver sends an old picture; "
            "plug the camera in again, look at its cable, and close other programs that use it "
            "(fuser -v /dev/video*)"
        )


def _sample(image: Image) -> NDArray[Any]:
    """Return pixels of an image (rows, columns), evenly spread over it, in counts."""
    step = max(1, math.isqrt(image.size // _SAMPLED))
    return image[step // 2 :: step, step // 2 :: step]


def differing_pixels(counts: NDArray[Any], camera: CameraConfig) -> float:
    """Return the least number of pixels expected to differ in a second frame.

    `counts` (rows, columns) in DN: pixels of the first frame.
    A pixel whose mean is a whole count differs least: as often as its noise exceeds half a count.
    Pixels at 0 and at full scale are clipped, and say nothing.
    """
    levels, pixels = np.unique(counts, return_counts=True)
    noise = _CAUTION * np.sqrt(photon_transfer(levels.astype(np.float64), camera))
    free = (levels > 0) & (levels < camera.max_dn) & (noise > 0)
    chance = [math.erfc(0.5 / (sigma * math.sqrt(2))) for sigma in noise[free]]
    return float(np.dot(pixels[free], chance))
