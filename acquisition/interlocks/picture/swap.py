"""Interlock on swapping sample and white tile: the picture must change with the surface.

An operator who presses Enter and leaves the tile on the table leaves a picture that is the same to
the noise of its pixels, texture, edges and level. A piece of the same material that is laid down
anew differs by its place: 0.05 pixels are seen along its edges.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from acquisition.measure.radiometry import photon_transfer
from acquisition.measure.rounding import rounding_u_dn
from acquisition.plan.plan import Step
from acquisition.plan.pose import Pose
from instrument.config.camera import CameraConfig
from instrument.devices import Frame, Surface
from instrument.geometry import FloatArray

_BLOCKS = (64, 48)  # columns and rows of a picture: small enough to keep, large enough for no noise
_SAME_LEVEL = 0.01  # the lamp drifts by less meanwhile; another material differs by more
_SAME_U = 4.5  # of a block, in standard uncertainties: 3 sigma, and a gain stated 2 times wrongly
_OTHERS = 0.005  # share of blocks that may differ: dust, a cable that moved; an edge has 2 %


@dataclass(frozen=True, slots=True)
class _Seen:
    """Counts per second (rows, columns) of the blocks of a picture, and their variance."""

    rate: FloatArray
    variance: FloatArray

    @classmethod
    def of(cls, frame: Frame, camera: CameraConfig) -> _Seen:
        import cv2

        pixels = frame.image.size / (_BLOCKS[0] * _BLOCKS[1])
        image = frame.image.astype(np.float32)
        mean = cv2.resize(image, _BLOCKS, interpolation=cv2.INTER_AREA).astype(np.float64)
        time_s, noise = frame.exposure_s, photon_transfer(mean, camera)
        # The darkest block's rounding is dithered least.
        variance = (noise + 1 / 12) / pixels + rounding_u_dn(float(noise.min())) ** 2
        dark_dn = camera.dark_current_electrons_per_s * time_s / camera.electrons_per_dn
        return cls((mean - camera.black_level_dn - dark_dn) / time_s, variance / time_s**2)

    def same(self, other: _Seen) -> bool:
        """True if both show the same, but for noise and a drift of the lamp."""
        total = float(np.vdot(self.rate, self.rate))
        level = float(np.vdot(self.rate, other.rate)) / total if total > 0 else 0.0
        if abs(level - 1) > _SAME_LEVEL:
            return False
        difference = other.rate - level * self.rate
        far = np.abs(difference) > _SAME_U * np.sqrt(self.variance + other.variance)
        return float(far.mean()) <= _OTHERS


@dataclass(slots=True)
class SwapCheck:
    """Pictures of references by pose, of the surface on the table and of the one before it.

    doubted: steps of the surface before, after a contradiction: it may be the wrong one.
    """

    camera: CameraConfig
    doubted: list[int] = field(default_factory=list)
    _surface: Surface | None = None
    _steps: list[int] = field(default_factory=list)
    _before: dict[Pose, _Seen] = field(default_factory=dict)
    _now: dict[Pose, _Seen] = field(default_factory=dict)

    def contradiction(self, frame: Frame, step: Step) -> str:
        """Note a picture; return how that of a reference contradicts a swap, empty if it does not.

        Points are only counted: there are too many to keep their pictures.
        """
        surface, pose = step.surface, step.pose
        if surface != self._surface:
            self._before, self._now = self._now, {}
            self.doubted, self._steps = self._steps, []
            self._surface = surface
        self._steps.append(step.index)
        if step.kind == "point":
            return ""
        seen = _Seen.of(frame, self.camera)
        self._now[pose] = seen
        if pose not in self._before or not self._before[pose].same(seen):
            return ""
        other = "sample" if surface == "white tile" else "white tile"
        return (
            f"interlock swap: at {pose} the picture of the {surface} is that of the {other} before "
            "it, in every part and to the noise of its pixels: look whether it is still on the "
            "table; if both are the same piece, take it off and lay it down again"
        )
