"""The one scene: which surface stands there, where lamp and camera really are, how bright it is.

The simulated stages write it, the simulated camera renders it, the simulated operator changes it
when asked. Everything random is keyed by the rig's seed and by what it belongs to (an axis and an
angle, a step of the plan and a frame), never by how often something was called, and the lamp ages
by the plan's time: the same protocol gives the same bytes, in one go or resumed.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field

import cv2
import numpy as np

from analysis.accuracy.render_brdf import adequate_brdf
from analysis.models import MODELS
from instrument.config.protocol import Protocol, SimulatedSample
from instrument.config.rig import Rig
from instrument.devices import Surface
from instrument.geometry import Brdf, FloatArray, IntArray


def key_of(text: str) -> int:
    """A stable number for a word, to key a random stream with."""
    return zlib.crc32(text.encode())


@dataclass(slots=True)
class Scene:
    """State of the bench. Angles in degrees are the true ones, which differ from what was asked."""

    rig: Rig
    protocol: Protocol
    sample: SimulatedSample
    surface: Surface = "sample"
    lit: bool = True
    step: int = 0
    planned_s: float = 0.0
    true_deg: dict[str, float] = field(default_factory=dict)
    rings: dict[tuple[str, float, float], IntArray] = field(default_factory=dict)
    _texture: FloatArray | None = None

    def begin_step(self, step: int, planned_s: float) -> None:
        """From now on the plan's step `step` is measured: its noise is its own.

        planned_s: the time in the plan at which it is read; the lamp's age, whatever the clock is.
        """
        self.step, self.planned_s = step, planned_s

    def random(self, *key: int) -> np.random.Generator:
        """A stream of random numbers that belongs to `key` alone."""
        return np.random.Generator(np.random.SFC64([self.rig.simulation.seed, *key]))

    def set_axis(self, axis: str, angle_deg: float) -> None:
        """Put an axis at an angle of the rig; its true angle is off by the axis's u, repeatably.

        A return to the same angle gives the same true angle, as a stage's cyclic error does.
        """
        u_deg = self.rig.axes[axis].u_deg
        key = round(angle_deg * 1e4) % 2**32
        error_deg = u_deg * self.random(key_of(axis), key).standard_normal()
        self.true_deg[axis] = float(angle_deg + error_deg)

    def brdf(self) -> Brdf:
        """Reflectance of the surface that stands there, in 1/sr."""
        if self.surface == "sample":
            if self.sample.method == "auto":
                return adequate_brdf(self.sample.model, self.sample.parameters)
            model, parameters = MODELS[self.sample.model], self.sample.parameters
            return lambda geometry: model.brdf(geometry, **parameters)
        albedo = self.tile_reflectance()
        return lambda geometry: MODELS["lambert"].brdf(geometry, albedo=albedo)

    def tile_reflectance(self) -> float:
        """What the white tile really reflects: its certificate's value within its uncertainty."""
        tile = self.protocol.references.white_tile
        if tile is None:
            raise ValueError("white tile asked for, but the protocol has none")
        error = tile.u_reflectance * self.random(key_of("white tile")).standard_normal()
        return float(min(1.0, tile.reflectance + error))

    def lamp_level(self) -> float:
        """The lamp's output relative to the start of the scan."""
        return 1.0 + self.rig.simulation.lamp_drift_per_hour * self.planned_s / 3600.0

    def mottling(self) -> tuple[FloatArray, float]:
        """Relative albedo texture of the sample, mean 0, and its grid's spacing in mm."""
        size = self.protocol.sample
        spacing_mm = self.sample.mottling_size_mm / 3.0
        rows = int(np.ceil(size.height_mm / spacing_mm)) + 1
        columns = int(np.ceil(size.width_mm / spacing_mm)) + 1
        if self.surface != "sample" or self.sample.mottling == 0:
            return np.zeros((rows, columns)), spacing_mm
        if self._texture is None:
            self._texture = self._make_texture(rows, columns)
        return self._texture, spacing_mm

    def _make_texture(self, rows: int, columns: int) -> FloatArray:
        """White noise, smoothed to patches of `mottling_size_mm` (three grid points)."""
        white = self.random(key_of("mottling")).standard_normal((rows, columns))
        smooth = cv2.GaussianBlur(white, (0, 0), 1.5, borderType=cv2.BORDER_REFLECT)
        smooth -= smooth.mean()
        texture: FloatArray = smooth * (self.sample.mottling / smooth.std())
        return texture
