"""The simulated camera: electrons, noise, full well, counts."""

from __future__ import annotations

import cv2
import numpy as np

from instrument.clock import Clock
from instrument.devices import Frame
from instrument.errors import DeviceError
from sim.render import FloatImage, electrons_per_s
from sim.scene import Scene, key_of

View = tuple[object, ...]  # what the picture depends on but for exposure and lamp level


class SimulatedCamera:
    """Renders the scene. Noise is keyed by the plan's step and the frame's number within it.

    Photon noise is drawn as normal with the mean's variance: from the few tens of electrons that
    the read noise alone amounts to, the difference from Poisson is far below one count.
    """

    def __init__(self, scene: Scene, clock: Clock) -> None:
        cv2.setNumThreads(1)  # so small a picture costs more to share out than to work on
        self._scene, self._clock = scene, clock
        self._settings = scene.rig.camera
        self._exposure_s = self._settings.min_exposure_s
        self._step, self._serial = -1, 0
        shape = (self._settings.height_px, self._settings.width_px)
        self._light_for: View = ()
        self._light = self._black = np.zeros(shape, np.float32)
        self._expected_for: tuple[View, float, float] = ((), 0.0, 0.0)
        self._expected = (self._light, self._light)
        self._noise = np.empty(shape, np.float32)
        self._counts = np.empty(shape, np.uint16)

    def identity(self) -> str:
        """What this camera is."""
        s = self._settings
        return f"simulated camera, {s.width_px} x {s.height_px} pixels, {s.bit_depth} bit"

    def set_exposure_s(self, exposure_s: float) -> float:
        """Set the exposure in seconds; outside the camera's range it is refused."""
        low, high = self._settings.min_exposure_s, self._settings.max_exposure_s
        if not low <= exposure_s <= high:
            raise DeviceError(
                f"camera: exposure {exposure_s:g} s asked for; it can do {low:g} to {high:g} s"
            )
        self._exposure_s = exposure_s
        return exposure_s

    def grab(self, count: int) -> list[Frame]:
        """Take `count` frames one after the other in simulated time.

        The lamp's level is that of the first: within one series it drifts by far less than 1e-5.
        """
        mean, spread = self._mean_and_spread_dn()
        return [self._frame(mean, spread) for _ in range(count)]

    def close(self) -> None:
        """Nothing to let go of."""

    def _frame(self, mean: FloatImage, spread: FloatImage) -> Frame:
        self._clock.sleep(self._exposure_s + self._settings.frame_overhead_s)
        noise = self._normal()
        np.multiply(noise, spread, out=noise)
        cv2.add(noise, mean, dst=self._counts, dtype=cv2.CV_16U)  # rounds, and saturates at 0
        counts = np.minimum(self._counts, self._settings.max_dn)
        image = counts.astype(np.uint8) if self._settings.bit_depth == 8 else counts
        return Frame(image, self._exposure_s, self._clock.now_s())

    def _mean_and_spread_dn(self) -> tuple[FloatImage, FloatImage]:
        """Expected counts of every pixel and their standard deviation, before rounding.

        Kept while view, exposure and lamp (to 1e-6 of its level) are the same.
        """
        scene = self._scene
        level = round(scene.lamp_level(self._clock.now_s()), 6) if scene.lit else 0.0
        view = (scene.surface, *sorted(scene.true_deg.items()))
        key = (view, self._exposure_s, level)
        if key != self._expected_for:
            light = self._light_of(view) if scene.lit else self._black
            self._expected = self._counts_of(light, level)
            self._expected_for = key
        return self._expected

    def _light_of(self, view: View) -> FloatImage:
        """Electrons per second at the lamp's full level."""
        if view != self._light_for:
            self._light, self._light_for = electrons_per_s(self._scene), view
        return self._light

    def _counts_of(self, light: FloatImage, level: float) -> tuple[FloatImage, FloatImage]:
        s = self._settings
        electrons = light * np.float32(level * self._exposure_s)
        electrons += np.float32(s.dark_current_electrons_per_s * self._exposure_s)
        np.minimum(electrons, np.float32(s.full_well_electrons), out=electrons)
        spread = np.sqrt(electrons + np.float32(s.read_noise_electrons**2))
        gain = np.float32(1 / s.electrons_per_dn)
        spread *= gain
        electrons *= gain
        electrons += np.float32(s.black_level_dn)
        return electrons, spread

    def _normal(self) -> FloatImage:
        """Standard normal noise. OpenCV's generator is four times as fast as NumPy's here."""
        if self._scene.step != self._step:
            self._step, self._serial = self._scene.step, 0
        self._serial += 1
        key = [self._scene.rig.simulation.seed, key_of("frame"), self._step, self._serial]
        cv2.setRNGSeed(int(np.random.SeedSequence(key).generate_state(1)[0] >> 1))
        cv2.randn(self._noise, np.zeros(1), np.ones(1))
        return self._noise
