"""Plan of a camera's calibration: darks, a flat field, and levels by exposure."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from acquisition.terminal.console import duration_text
from instrument.config.camera import CameraConfig
from instrument.config.rig import Rig
from instrument.errors import InputError

LEAST_EXPOSURES, MOST_EXPOSURES = 12, 200
LEAST_FRAMES, MOST_FRAMES = 2, 64
DARK_EXPOSURES = 6
FLAT_FRAMES = 16
FLAT_TARGET = 0.5  # of full scale: where EMVA 1288 measures PRNU
_LOW = 4  # exposures below those of the even ladder, where a gamma bends most
_TOP = 1.15  # of the exposure that saturates: some levels must be above it


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationPlan:
    """Numbers of exposures and of frames; `exposures` lit ones, of which some saturate."""

    rig: Rig
    exposures: int = 30
    frames: int = 4

    def __post_init__(self) -> None:
        """Refuse numbers with which nothing could be determined."""
        for option, value, low, high in (
            ("--exposures", self.exposures, LEAST_EXPOSURES, MOST_EXPOSURES),
            ("--frames", self.frames, LEAST_FRAMES, MOST_FRAMES),
        ):
            if not low <= value <= high:
                raise InputError(
                    f"gonio calibrate camera: {option} {value}; allowed: {low} to {high}. Nothing "
                    "has been measured"
                )

    def dark_exposures_s(self) -> list[float]:
        """Return the exposures of the darks in seconds, from the shortest to the longest."""
        camera = self.rig.camera
        ideal = np.geomspace(camera.min_exposure_s, camera.max_exposure_s, DARK_EXPOSURES)
        return possible_s(ideal.tolist(), camera)

    def lit_exposures_s(self, saturating_s: float) -> list[float]:
        """Return the exposures of the lit levels in seconds, rising, to beyond saturation."""
        even = np.linspace(0.04, _TOP, self.exposures - _LOW)
        low = np.geomspace(0.005, 0.03, _LOW)
        ideal = saturating_s * np.concatenate([low, even])
        return possible_s(ideal.tolist(), self.rig.camera)

    def expected_saturating_s(self) -> float:
        """Return the exposure in seconds that fills the well by the rig file's numbers."""
        camera = self.rig.camera
        filled = camera.full_well_electrons / self.rig.lamp.white_electrons_per_s
        return min(filled, camera.max_exposure_s)

    def duration_s(self) -> float:
        """Return the expected duration in seconds, without the operator's work."""
        overhead = self.rig.camera.frame_overhead_s
        full_s = self.expected_saturating_s()
        lit = [self.frames * (e + overhead) for e in self.lit_exposures_s(full_s)]
        dark = [self.dark_frames(e) * (e + overhead) for e in self.dark_exposures_s()]
        return sum(lit) + sum(dark) + FLAT_FRAMES * (full_s / 2 + overhead)

    def dark_frames(self, exposure_s: float) -> int:
        """Return the frames of a dark: more at both ends, from which each pixel's values come."""
        camera = self.rig.camera
        ends = (camera.min_exposure_s, camera.max_exposure_s)
        return FLAT_FRAMES if exposure_s in ends else self.frames

    def lines(self) -> Iterator[str]:
        """Yield the plan in words."""
        rig, darks = self.rig, self.dark_exposures_s()
        yield (
            f"calibration of the camera of the rig {rig.name}: "
            f"{rig.camera.width_px} x {rig.camera.height_px} pixels, {rig.camera.bit_depth} bit"
        )
        yield "1. the operator places a matt white surface that fills the picture; nothing moves"
        yield f"2. lamp lit: a flat field at half of full scale, {FLAT_FRAMES} frames"
        yield (
            f"3. lamp dark: {len(darks)} exposures of {darks[0]:g} to {darks[-1]:g} s, "
            f"{self.frames} frames each, {FLAT_FRAMES} at both ends"
        )
        yield (
            f"4. lamp lit: {self.exposures} exposures up to saturation, {self.frames} frames each, "
            "in an order that no drift of the lamp can imitate"
        )
        yield (
            f"takes about {duration_text(max(self.duration_s(), 1.0))} beside the operator's work, "
            f"if a pixel saturates at {self.expected_saturating_s():.3g} s"
        )


def possible_s(ideal_s: list[float], camera: CameraConfig) -> list[float]:
    """Return exposures in seconds that the camera can take, rising, each once."""
    low, high = camera.min_exposure_s, camera.max_exposure_s
    exact = (nearest_s(e, camera) for e in ideal_s if e >= low * 0.999)
    return sorted({min(max(e, low), high) for e in exact})


def nearest_s(ideal_s: float, camera: CameraConfig) -> float:
    """Return the exposure in seconds nearest to an ideal one that the camera can be asked for."""
    step_s = camera.exposure_step_s
    whole_s = round(ideal_s / step_s) * step_s if step_s else ideal_s
    return float(f"{whole_s:.6g}")
