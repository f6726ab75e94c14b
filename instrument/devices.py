"""Device interfaces: what the scan needs of a stage, a camera, a lamp and an operator.

Real drivers and simulated devices implement the same interfaces, so the scan does not know which it
uses. Angles are the device's own degrees; `acquisition.engine.axis` converts them to the rig's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8] | NDArray[np.uint16]
CHANNELS = ("r", "g", "b")
"""Channels of a colour picture, in the order of its last axis."""
GREEN = CHANNELS.index("g")
TRUSTED_SHARE = 0.97
"""Share of full scale above which a camera's response is not trusted."""
REPLY_S = 0.15
"""Time allowed for a controller's answer in s, unless the rig file gives its own `reply_s`.

Controllers answer within 10 to 50 ms. A stop waits no longer than this, and a lost answer is asked
for again before the status of a moving stage is too old.
"""
Surface = Literal["sample", "white tile"]
BoardPlace = Literal["board", "turned board"]
"""Places of the calibration board, where else the sample is: the second after half a turn."""
CHANGING_SETTINGS = frozenset({"exposure", "frame period", "frame numbers"})
"""Settings of a camera that differ during a scan, or are measured anew when it is opened."""


@dataclass(frozen=True, slots=True)
class Frame:
    """One image: `image[row, column]` in counts (DN), its exposure and time of read-out.

    `device_time_s`: the camera's own time stamp in seconds of the monotonic clock, None if none.
    `sequence`: number of the frame by the camera's driver, None if it does not count. `colour`: of
    a colour camera, counts (rows, columns, 3) in the order of `CHANNELS`, of which `image` is then
    `mono_picture`; None for any other.
    """

    image: Image
    exposure_s: float
    time_s: float
    device_time_s: float | None = None
    sequence: int | None = None
    colour: Image | None = None

    def brightest(self, crop: tuple[slice, slice]) -> Image:
        """Return the counts (rows, columns) of a crop by which an exposure is judged.

        Those of the brightest channel of each pixel.
        """
        if self.colour is None:
            return self.image[crop]
        counts: Image = self.colour[crop].max(axis=-1)
        return counts


def mono_picture(colour: Image, max_dn: int) -> Image:
    """Return the picture (rows, columns) that stands for a colour one (rows, columns, 3), in DN.

    It is the green channel, whose noise is that of one pixel. Where any channel is above the counts
    that are trusted, the pixel has full scale, so that whoever reads it finds it saturated.
    """
    mono: Image = colour[..., GREEN].copy()
    mono[(colour >= TRUSTED_SHARE * max_dn).any(axis=-1)] = max_dn
    return mono


@dataclass(frozen=True, slots=True)
class Request:
    """Request to the operator, in words and in terms on which a simulated scene can act."""

    action: Literal["set axis", "place", "cover lamp", "uncover lamp"]
    text: str
    axis: str = ""
    angle_deg: float = 0.0
    surface: Surface | BoardPlace = "sample"


class Operator(Protocol):
    """Person at the rig, or the simulated scene in their place."""

    def ask(self, request: Request) -> str:
        """Return the answer once the request is done; raise `OperatorStop` if it is refused."""


class Stage(Protocol):
    """Rotary axis with absolute moves, in the device's own degrees."""

    def identity(self) -> str:
        """Return maker, model and serial number as the device gives them."""

    def home(self) -> None:
        """Search for the reference; no other motion is allowed before."""

    def homed(self) -> bool:
        """Return True if the axis, at rest, knows its reference; always so if set by hand."""

    def settings(self) -> dict[str, str]:
        """Return settings by name, read back from the device if possible; units in the names."""

    def set_speed(self, speed_deg_per_s: float) -> None:
        """Let later moves turn at this speed, up to that of the rig file; the axis must rest."""

    def start_move(self, angle_deg: float) -> None:
        """Start a move to `angle_deg` and return at once."""

    def wait(self) -> float:
        """Wait for the end of the move and return the position in degrees."""

    def position_deg(self) -> float:
        """Return the position in degrees, also during a move."""

    def limits_deg(self) -> tuple[float, float]:
        """Return the smallest and the largest angle in degrees that the axis accepts."""

    def begin_stop(self) -> None:
        """Send a stop now and return; may be called at any time, twice, and from another thread."""

    def finish_stop(self) -> None:
        """Return once the axis was read to stand; repeat a stop without effect until then.

        Raise `DeviceError`, in a bounded time, if it still moves or cannot be read.
        """

    def stop(self) -> None:
        """Begin and finish a stop."""

    def close(self) -> None:
        """Release the device; may be called twice."""


class Camera(Protocol):
    """Camera that returns raw counts."""

    def identity(self) -> str:
        """Return maker, model and serial number as the device gives them."""

    def settings(self) -> dict[str, str]:
        """Return settings by name, read back from the device if possible; units in the names."""

    def set_exposure_s(self, exposure_s: float) -> float:
        """Set the exposure and return the value read back, in seconds."""

    def grab(self, count: int) -> list[Frame]:
        """Return `count` frames whose exposure began after this call."""

    def close(self) -> None:
        """Release the device; may be called twice."""


class Lamp(Protocol):
    """Lamp, with the shutter or lid in front of it."""

    def identity(self) -> str:
        """Return what darkens the lamp: the device's identity, or the operator."""

    def darken(self) -> None:
        """Block all light on the sample."""

    def light(self) -> None:
        """Let full light onto the sample."""
