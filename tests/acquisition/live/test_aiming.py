"""Aiming: the sharpest picture so far is remembered, and the newest one shown."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
import pytest

from acquisition.live import channel
from acquisition.live.aiming import Aiming
from acquisition.live.publisher import Publisher
from acquisition.measure.window import window_at
from instrument.clock import SystemClock
from instrument.config.load import Loaded
from instrument.devices import Frame
from instrument.pinhole import Pinhole
from tests.support.timing.deadline import wait_for


def frames_of_a_turned_lens(demo: Loaded) -> Iterator[Frame]:
    """Blur that falls, vanishes, and grows again."""
    camera = demo.rig.camera
    texture = np.random.default_rng(3).uniform(500.0, 3000.0, (camera.height_px, camera.width_px))
    for blur_px in (6.0, 3.0, 1.0, 2.0, 5.0):
        image = cv2.GaussianBlur(texture, (0, 0), blur_px).astype(np.uint16)
        yield Frame(image, 0.01, 0.0)


@pytest.mark.usefixtures("own_folder")
def test_the_best_sharpness_is_kept_while_the_lens_is_turned_beyond_it(demo: Loaded) -> None:
    patch, folder = demo.protocol.window, channel.user_folder() / "aim-1"
    window = window_at(0.0, Pinhole.of(demo.rig), patch.width_mm, patch.height_mm)
    taken: list[Frame] = []
    shown: list[tuple[float, float]] = []
    frames = frames_of_a_turned_lens(demo)

    def take() -> Frame:
        """Each frame once the page has shown the one before; then the operator ends it."""
        if taken:
            wait_for(lambda: number() == len(taken), "the picture")
            state = channel.read_state(folder) or {}
            shown.append((state["picture"]["sharpness"], state["picture"]["best_sharpness"]))
            assert state["phase"] == "aiming"
        channel.send(folder, channel.WATCH)
        frame = next(frames, None)
        if frame is None:
            raise KeyboardInterrupt
        taken.append(frame)
        return frame

    def number() -> int:
        picture = (channel.read_state(folder) or {}).get("picture")
        return 0 if picture is None else int(picture["number"])

    aiming = Aiming(
        publisher=Publisher(folder, demo.rig.camera), camera=demo.rig.camera, window=window,
        take=take, clock=SystemClock(),
    )  # fmt: skip
    with pytest.raises(KeyboardInterrupt):
        aiming.run()
    sharp = [now for now, _ in shown]
    assert sharp.index(max(sharp)) == 2
    assert [best for _, best in shown] == list(np.maximum.accumulate(sharp))
    assert not folder.exists()
