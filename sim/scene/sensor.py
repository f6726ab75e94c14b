"""Image sensor: turns rendered electrons per second into counts, with noise and a full well."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy

import cv2
import numpy as np

from instrument.config.camera import CameraConfig
from instrument.devices import CHANNELS, GREEN, Image
from sim.defects.camera import (
    bent,
    dark_current_factor,
    hot_electrons_per_s,
    is_bent,
    unequal_darks_electrons,
    unequal_responses,
)
from sim.defects.picture import distorted, mixed_up, stray_electrons_per_s
from sim.defects.world import SOUND
from sim.scene.render import FloatImage, electrons_per_s
from sim.scene.scene import NODE_WEIGHTS, Scene, stream_key

_SceneState = tuple[object, ...]  # surface, true angles and faults: all that an image depends on


class Sensor:
    """Sensor that looks at `scene`.

    The noise belongs to a frame, not to a call. It is keyed by the plan's step (for a dark frame
    only by its being dark), the exposure, and the frame's number since either last changed, so
    that repeating a step gives the same frames.

    `channel`: of a colour camera, 0 for red, with the sample's albedo and the response there; None
    for a camera of one. Each has noise of its own, green that of a camera of one channel.

    Photon noise is normal with the variance of the mean: above the few tens of electrons of the
    read noise its difference from a Poisson distribution is far below one count.
    """

    def __init__(self, scene: Scene, channel: int | None = None) -> None:
        cv2.setNumThreads(1)  # images are so small that several threads are slower than one
        self.scene, self._channel = scene, channel
        self._settings: CameraConfig = scene.rig.camera
        self._series: tuple[int, ...] = ()
        self._frame_number = 0
        shape = (self._settings.height_px, self._settings.width_px)
        self._defects = defects = scene.rig.simulation.camera_defects
        names = ("PRNU", "DSNU", "hot pixels")
        prnu, dsnu, hot = (scene.random(stream_key(name)) for name in names)
        self._hot = hot_electrons_per_s(shape, defects, hot)
        self._responses = unequal_responses(shape, defects, prnu)
        self._darks_electrons = unequal_darks_electrons(shape, defects, dsnu)
        self._light_state: _SceneState = ()
        self._poses: tuple[dict[str, float], ...] = ()
        self._light = self._no_light = np.zeros(shape, np.float32)
        self._expected_key: tuple[_SceneState, float, float, float] = ((), 0.0, 0.0, 0.0)
        self._expected = (self._light, self._light)
        self._noise = np.empty(shape, np.float32)
        self._counts = np.empty(shape, np.uint16)
        self._last: Image | None = None

    def picture(self, exposure_s: float, poses: Sequence[dict[str, float]] = ()) -> Image:
        """Return an image of the scene in its present state, (height, width) in counts.

        poses: true angles of the axes, over which the light is averaged; the present ones if empty.

        The expected counts are reused while scene, exposure and lamp level (to 1e-6) stay the same.
        """
        self._count_frame(exposure_s)
        self._poses = tuple(poses) or (self.scene.true_deg,)
        world, settings = self.scene.world, self._settings
        mean, spread = self._mean_and_spread_dn(exposure_s)
        noise = self._standard_normal()
        np.multiply(noise, spread, out=noise)
        if world.noise != 1.0:
            noise *= np.float32(world.noise)
        if is_bent(self._defects):
            mean = bent(noise + mean, settings, self._defects)
            noise[:] = 0
        cv2.add(noise, mean, dst=self._counts, dtype=cv2.CV_16U)  # rounds, and saturates at 0
        counts = np.minimum(self._counts, settings.max_dn)
        image: Image = counts.astype(np.uint8) if settings.bit_depth == 8 else counts
        if world is not SOUND:
            image = distorted(image, world, settings)
            image = mixed_up(image, self._frame_number, self._last, world, settings)
        self._last = image
        return image

    def _mean_and_spread_dn(self, exposure_s: float) -> tuple[FloatImage, FloatImage]:
        """Expected counts of each pixel and their standard deviation, before rounding."""
        scene = self.scene
        level = round(scene.lamp_level(), 6) * scene.world.light(scene.lit) * self._flicker()
        angles = (tuple(sorted(pose.items())) for pose in self._poses)
        state = (scene.surface, *angles, scene.world)
        warmth = round(dark_current_factor(scene.age_s(), self._defects), 4)
        key = (state, exposure_s, level, warmth)
        if key != self._expected_key:
            light = self._light_of(state) if level else self._no_light
            self._expected = self._expected_dn(light, level, exposure_s, warmth)
            self._expected_key = key
        return self._expected

    def _light_of(self, state: _SceneState) -> FloatImage:
        """Electrons per second at lamp level 1."""
        if state != self._light_state:
            lights = [self._light_at(pose) for pose in self._poses]
            self._light = lights[0] if len(lights) == 1 else _mean_of(lights)
            self._light_state = state
        return self._light

    def _light_at(self, pose: dict[str, float]) -> FloatImage:
        scene, own = self.scene, self.scene.true_deg
        scene.true_deg = pose
        try:
            return self._electrons_per_s()
        finally:
            scene.true_deg = own

    def _electrons_per_s(self) -> FloatImage:
        scene, channel = self.scene, self._channel
        if channel is None:
            return electrons_per_s(scene)
        if scene.sample.mottling > 0:
            scene.mottling()  # computed once, for all channels
        own, responses = copy(scene), scene.rig.simulation.channel_responses
        own.sample = scene.sample.in_channel(channel)
        light = electrons_per_s(own)
        return light if responses is None else light * np.float32(responses[channel])

    def _expected_dn(
        self, light: FloatImage, level: float, exposure_s: float, warmth: float
    ) -> tuple[FloatImage, FloatImage]:
        s = self._settings
        electrons = light * np.float32(level * exposure_s)
        if self._responses is not None:
            electrons *= self._responses
        electrons += np.float32(s.dark_current_electrons_per_s * exposure_s * warmth)
        if self.scene.world is not SOUND:
            white = self.scene.rig.lamp.white_electrons_per_s
            stray = stray_electrons_per_s(self.scene.world, s, white)
            electrons += stray * np.float32(exposure_s)
        if self._hot is not None:
            electrons += (self._hot * (exposure_s * warmth)).astype(np.float32)
        np.minimum(electrons, np.float32(s.full_well_electrons), out=electrons)
        spread = np.sqrt(electrons + np.float32(s.read_noise_electrons**2))
        if self._darks_electrons is not None:
            electrons += self._darks_electrons
        world = self.scene.world
        gain = np.float32(world.gain * world.amplifier / s.electrons_per_dn)
        spread *= gain
        electrons *= gain
        electrons += np.float32(s.black_level_dn)
        return electrons, spread

    def _flicker(self) -> float:
        """Return the factor of the lamp's light in this frame."""
        lamp = self.scene.rig.simulation.lamp_defects
        sigma = float(np.hypot(self.scene.world.flicker, lamp.flicker))
        if not sigma:
            return 1.0
        random = self.scene.random(stream_key("flicker"), *self._series[1:], self._frame_number)
        return 1.0 + sigma * float(random.standard_normal())

    def _count_frame(self, exposure_s: float) -> None:
        """Find the key of the next frame's noise."""
        scene = self.scene
        step_key = (stream_key("frame"), scene.step) if scene.lit else (stream_key("dark"),)
        series = (scene.rig.simulation.seed, *step_key, round(exposure_s * 1e9))
        self._frame_number = self._frame_number + 1 if series == self._series else 0
        self._series = series

    def _standard_normal(self) -> FloatImage:
        """Standard normal noise; OpenCV's generator is four times as fast here as NumPy's."""
        own = [] if self._channel in (None, GREEN) else [1 + (self._channel or 0)]
        key = [*self._series, self._frame_number, *own]
        cv2.setRNGSeed(int(np.random.SeedSequence(key).generate_state(1)[0] >> 1))
        cv2.randn(self._noise, np.zeros(1), np.ones(1))
        return self._noise


def sensors_of(scene: Scene) -> list[Sensor]:
    """Return the sensors of the rig's camera: one, or one for each channel of a colour camera."""
    if not scene.rig.camera.is_colour:
        return [Sensor(scene)]
    return [Sensor(scene, channel) for channel in range(len(CHANNELS))]


def in_one(pictures: Sequence[Image]) -> Image:
    """Return pictures (rows, columns) of channels, in counts, as one (rows, columns, channels).

    A single one stays as it is.
    """
    if len(pictures) == 1:
        return pictures[0]
    colour = np.empty((*pictures[0].shape, len(pictures)), dtype=pictures[0].dtype)
    for n, picture in enumerate(pictures):
        colour[..., n] = picture
    return colour


def _mean_of(lights: Sequence[FloatImage]) -> FloatImage:
    """Mean over an exposure of the light at its nodes, (height, width) each."""
    mean = np.zeros_like(lights[0])
    for weight, light in zip(NODE_WEIGHTS, lights, strict=True):
        mean += np.float32(weight) * light
    return mean
