"""The sensor behind every picture of the scene: electrons, noise, full well, counts."""

from __future__ import annotations

import cv2
import numpy as np

from instrument.config.camera import CameraConfig
from instrument.devices import Image
from sim.scene.render import FloatImage, electrons_per_s
from sim.scene.scene import Scene, key_of

View = tuple[object, ...]  # what the picture depends on but for exposure and lamp level


class Sensor:
    """Turns the scene into counts, with noise that belongs to a frame and not to a call.

    It is keyed by the plan's step (a dark's by that it is dark), the exposure, and the frame's
    number since these were last changed: a step that is taken again is taken the same.

    Photon noise is drawn as normal with the mean's variance: from the few tens of electrons that
    the read noise alone amounts to, the difference from Poisson is far below one count.
    """

    def __init__(self, scene: Scene) -> None:
        cv2.setNumThreads(1)  # so small a picture costs more to share out than to work on
        self._scene = scene
        self._settings: CameraConfig = scene.rig.camera
        self._series: tuple[int, ...] = ()
        self._number = 0
        shape = (self._settings.height_px, self._settings.width_px)
        self._light_for: View = ()
        self._light = self._black = np.zeros(shape, np.float32)
        self._expected_for: tuple[View, float, float] = ((), 0.0, 0.0)
        self._expected = (self._light, self._light)
        self._noise = np.empty(shape, np.float32)
        self._counts = np.empty(shape, np.uint16)

    def picture(self, exposure_s: float) -> Image:
        """Counts of the scene as it is.

        The mean is kept while view, exposure and lamp (to 1e-6 of its level) are the same.
        """
        mean, spread = self._mean_and_spread_dn(exposure_s)
        noise = self._normal(exposure_s)
        np.multiply(noise, spread, out=noise)
        cv2.add(noise, mean, dst=self._counts, dtype=cv2.CV_16U)  # rounds, and saturates at 0
        counts = np.minimum(self._counts, self._settings.max_dn)
        return counts.astype(np.uint8) if self._settings.bit_depth == 8 else counts

    def _mean_and_spread_dn(self, exposure_s: float) -> tuple[FloatImage, FloatImage]:
        """Expected counts of every pixel and their standard deviation, before rounding."""
        scene = self._scene
        level = round(scene.lamp_level(), 6) if scene.lit else 0.0
        view = (scene.surface, *sorted(scene.true_deg.items()))
        key = (view, exposure_s, level)
        if key != self._expected_for:
            light = self._light_of(view) if scene.lit else self._black
            self._expected = self._counts_of(light, level, exposure_s)
            self._expected_for = key
        return self._expected

    def _light_of(self, view: View) -> FloatImage:
        """Electrons per second at the lamp's full level."""
        if view != self._light_for:
            self._light, self._light_for = electrons_per_s(self._scene), view
        return self._light

    def _counts_of(
        self, light: FloatImage, level: float, exposure_s: float
    ) -> tuple[FloatImage, FloatImage]:
        s = self._settings
        electrons = light * np.float32(level * exposure_s)
        electrons += np.float32(s.dark_current_electrons_per_s * exposure_s)
        np.minimum(electrons, np.float32(s.full_well_electrons), out=electrons)
        spread = np.sqrt(electrons + np.float32(s.read_noise_electrons**2))
        gain = np.float32(1 / s.electrons_per_dn)
        spread *= gain
        electrons *= gain
        electrons += np.float32(s.black_level_dn)
        return electrons, spread

    def _normal(self, exposure_s: float) -> FloatImage:
        """Standard normal noise. OpenCV's generator is four times as fast as NumPy's here."""
        scene = self._scene
        of = (key_of("frame"), scene.step) if scene.lit else (key_of("dark"),)
        series = (scene.rig.simulation.seed, *of, round(exposure_s * 1e9))
        self._number = self._number + 1 if series == self._series else 0
        self._series = series
        key = [*series, self._number]
        cv2.setRNGSeed(int(np.random.SeedSequence(key).generate_state(1)[0] >> 1))
        cv2.randn(self._noise, np.zeros(1), np.ones(1))
        return self._noise
