"""Contract of a camera, as checks that raise `AssertionError`: simulated, emulated and real.

The checks look at light: the camera must see a lit surface that does not flicker, which saturates
at its longest exposure.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from acquisition.measure.radiometry import SATURATION_FRACTION, bright_level
from acquisition.plan.exposure_ladder import exposure_ladder_s, longest_exposure_s
from instrument.config.camera import CameraConfig
from instrument.devices import Camera, Frame, Image
from instrument.errors import DeviceError
from instrument.geometry import BoolArray

LONGEST_S = 0.25  # of the exposures that are tried, where the light allows it
_TARGET, _PLACES, _TOLERANCE = 0.7, 7, 0.02

Check = Callable[[Camera, CameraConfig], None]


def suitable_s(camera: Camera, config: CameraConfig) -> float:
    """Exposure at which the brightest part of the image is at about 0.7 of full scale."""
    exposure_s = longest_exposure_s(LONGEST_S, config)
    span = config.max_dn - config.black_level_dn
    for _ in range(8):
        camera.set_exposure_s(exposure_s)
        frame = camera.grab(1)[0]
        peak = bright_level(frame.image)
        saturated = peak >= SATURATION_FRACTION * config.max_dn
        share = max(peak - config.black_level_dn, 0.5) / span
        limit_s = frame.exposure_s * (0.25 if saturated else _TARGET / share)
        better_s = longest_exposure_s(min(limit_s, LONGEST_S), config)
        if better_s == exposure_s:
            break
        exposure_s = better_s
    return exposure_s


def lit_pixels(image: Image, config: CameraConfig) -> BoolArray:
    """Mask of the pixels with a good signal that are not saturated."""
    span = config.max_dn - config.black_level_dn
    share = (image.astype(float) - config.black_level_dn) / span
    lit: BoolArray = (share > 0.25) & (share < 0.9)
    assert lit.sum() >= 100, "fewer than 100 lit pixels: aim the camera at an evenly lit surface"
    return lit


def check_identity(camera: Camera, config: CameraConfig) -> None:
    assert f"{config.bit_depth} bit" in camera.identity()


def check_frames(camera: Camera, config: CameraConfig) -> None:
    """Frames are images of counts of the size in the rig file, in order, with stamps that rise."""
    camera.set_exposure_s(config.min_exposure_s)
    frames = [*camera.grab(4), *camera.grab(3)]
    assert {f.image.shape for f in frames} == {(config.height_px, config.width_px)}
    assert all(f.image.dtype in (np.uint8, np.uint16) for f in frames)
    for times in ([f.time_s for f in frames], [f.device_time_s for f in frames]):
        known = [time for time in times if time is not None]
        assert known == sorted(set(known)), "time stamps that do not rise"


def check_exposures(camera: Camera, config: CameraConfig) -> None:
    """Frames have the exposure that was confirmed, near the one asked for."""
    ladder = [e for e in exposure_ladder_s(config) if e <= LONGEST_S]
    for exposure_s in (ladder[0], ladder[-1], ladder[len(ladder) // 2]):
        taken_s = camera.set_exposure_s(exposure_s)
        assert taken_s == pytest.approx(exposure_s, rel=0.5)
        assert {f.exposure_s for f in camera.grab(3)} == {taken_s}


def check_range(camera: Camera, config: CameraConfig) -> None:
    """An exposure out of range is refused, and the one before stays."""
    before_s = camera.set_exposure_s(config.min_exposure_s)
    for exposure_s in (0.0, -1.0, 1e6, float("nan")):
        with pytest.raises(DeviceError, match=r"exposure .* s asked for"):
            camera.set_exposure_s(exposure_s)
    assert camera.grab(1)[0].exposure_s == before_s


def check_memory(camera: Camera, config: CameraConfig) -> None:
    """A frame is unchanged when others are taken."""
    camera.set_exposure_s(config.min_exposure_s)
    first = camera.grab(1)[0]
    before = first.image.copy()
    camera.set_exposure_s(longest_exposure_s(4 * config.min_exposure_s, config))
    camera.grab(6)
    assert np.array_equal(first.image, before)


def check_linearity(camera: Camera, config: CameraConfig) -> None:
    """Counts lie on a straight line over the exposure, from the black level on."""
    top_s = suitable_s(camera, config)
    lit = lit_pixels(_taken(camera, top_s).image, config)
    exposures = np.geomspace(max(config.min_exposure_s, top_s / 16), top_s, _PLACES)
    frames = [_taken(camera, longest_exposure_s(e * 1.01, config)) for e in exposures]
    exposure_s = np.array([f.exposure_s for f in frames])
    counts = np.array([f.image[lit].mean() for f in frames])
    assert np.ptp(exposure_s) > 0.5 * top_s, "the light is too strong for two exposures"
    slope, black = np.polyfit(exposure_s, counts, 1, w=1 / np.sqrt(counts))
    expected = black + slope * exposure_s
    text = ", ".join(f"{c:.1f} at {e:g} s" for c, e in zip(counts, exposure_s, strict=True))
    assert slope * np.ptp(exposure_s) > 0.1 * config.max_dn, f"no light follows: {text}"
    allowed = _TOLERANCE * np.abs(counts - black) + 0.6  # DN, of rounding
    assert np.all(np.abs(counts - expected) < allowed), f"counts are not proportional: {text}"
    off = abs(black - config.black_level_dn)
    assert off < _TOLERANCE * config.max_dn, f"black is {black:.1f} by the line through {text}"


def check_first_frame(camera: Camera, config: CameraConfig) -> None:
    """The first frame after a change has the new exposure, as those after it have."""
    long_s = suitable_s(camera, config)
    short_s = longest_exposure_s(long_s / 4, config)
    lit = lit_pixels(_taken(camera, long_s).image, config)
    for exposure_s in (short_s, long_s) * 3:
        camera.set_exposure_s(exposure_s)
        levels = [float(f.image[lit].mean()) for f in camera.grab(1) + camera.grab(7)]
        steady = levels[-1]
        allowed = _TOLERANCE * steady + 0.6
        assert abs(levels[0] - steady) < allowed, f"at {exposure_s:g} s, frame by frame: {levels}"


def check_saturation(camera: Camera, config: CameraConfig) -> None:
    """An overexposed image reaches the full scale at which the program sees saturation."""
    exposure_s = suitable_s(camera, config)
    while True:
        longer_s = longest_exposure_s(4 * exposure_s, config)
        image = _taken(camera, longer_s).image
        brightest, plateau = int(image.max()), np.mean(image == image.max())
        if plateau > 0.01 or longer_s == exposure_s:
            break
        exposure_s = longer_s
    assert plateau > 0.01, (
        f"nothing saturates at the longest exposure, {exposure_s:g} s: {brightest} counts at "
        "most, more light is needed"
    )
    assert brightest >= SATURATION_FRACTION * config.max_dn, (
        f"an overexposed image stays at {brightest} of {config.max_dn} counts: bit_depth or "
        "luma_range of the rig file is wrong"
    )


def _taken(camera: Camera, exposure_s: float) -> Frame:
    camera.set_exposure_s(exposure_s)
    return camera.grab(1)[0]


CHECKS: dict[str, Check] = {
    name.removeprefix("check_"): value
    for name, value in list(globals().items())
    if name.startswith("check_")
}
