"""Settings of a V4L2 camera: exposures in whole steps, values that go together."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from drivers.v4l2.settings import V4l2Settings
from instrument.errors import DeviceError
from tests.support.v4l2.remote_camera import (
    DEVICE,
    QUICK,
    SETTINGS,
)


@pytest.mark.parametrize(
    ("exposure_s", "message"),
    [
        (0.00015, r"0.00015 s asked for; allowed: 0.001 to 2 s"),
        (0.00125, r"0.00125 s asked for; allowed: multiples of 0.0001 s, the nearest is 0.0012 s"),
        (2.5, r"2.5 s asked for; allowed: 0.001 to 2 s"),
        (float("nan"), r"nan s asked for; allowed: 0.001 to 2 s"),
    ],
)
def test_an_exposure_out_of_range_or_between_steps_is_refused(
    exposure_s: float, message: str
) -> None:
    with pytest.raises(DeviceError, match=message):
        SETTINGS.exposure_steps(exposure_s)


def test_every_step_of_the_exposure_can_be_written_in_seconds() -> None:
    for count in range(10, 20_001):
        assert SETTINGS.exposure_steps(count / 10_000) == count


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"min_exposure_s": 0.00005}, "multiples of 0.0001 s"),
    ],
)
def test_settings_that_contradict_each_other_are_refused(
    changes: dict[str, Any], message: str
) -> None:
    with pytest.raises(DeviceError, match=message):
        replace(SETTINGS, **changes)


def test_default_settings() -> None:
    least = V4l2Settings(
        device=DEVICE, pixel_format="GREY", width_px=512, height_px=480, bit_depth=8,
        min_exposure_s=0.0001, max_exposure_s=1.0,
    )  # fmt: skip
    assert (least.gain, least.exposure_delay_frames) == (None, 2)
    assert QUICK.frames_per_s == 200
