"""Side of the scan of a live page: a channel with a state, and the commands that came."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.live.channel import OK, channel_of
from acquisition.live.publisher import Publisher, Seen
from acquisition.measure.window import window_at
from instrument.config.camera import CameraConfig
from instrument.config.load import Loaded
from instrument.devices import Frame
from instrument.pinhole import Pinhole
from instrument.record.record import FILE_NAME


@dataclass
class ScanSide:
    """State that is published, and the commands that came; `refuses`: the answer to them."""

    publisher: Publisher
    loaded: Loaded
    phase: str = "measuring"
    refuses: str = ""
    commands: list[str] = field(default_factory=list)

    def state(self) -> dict[str, Any]:
        axis = {"deg": 30.0, "by_hand": True, "moving": False}
        return {
            "phase": self.phase, "text": f"text of {self.phase}", "step": None,
            "axes": {"theta_i": axis, "theta_r": {**axis, "deg": None, "by_hand": False}},
            "lamp": "lit",
        }  # fmt: skip

    def follow(self, command: str) -> str:
        self.commands.append(command)
        return self.refuses or OK

    def show(self, level_dn: int, **about: object) -> None:
        """Publish an even picture with these counts."""
        patch, camera = self.loaded.protocol.window, self.loaded.rig.camera
        window = window_at(0.0, Pinhole.of(self.loaded.rig), patch.width_mm, patch.height_mm)
        image = np.full((camera.height_px, camera.width_px), level_dn, np.uint16)
        self.publisher.show(Seen(Frame(image, 0.01, 0.0), window, {"caption": "a view", **about}))


@contextmanager
def scan_side(run: Path, loaded: Loaded) -> Iterator[ScanSide]:
    """Channel of the scan of a run, in the test's own process."""
    with channel_side(channel_of(run / FILE_NAME), loaded) as side:
        yield side


@contextmanager
def channel_side(channel: Path, loaded: Loaded) -> Iterator[ScanSide]:
    camera: CameraConfig = loaded.rig.camera
    side = ScanSide(Publisher(channel, camera), loaded)
    with side.publisher.published(side.state, side.follow):
        yield side
