"""Device interfaces: what the engine needs of a stage, a camera, a lamp and an operator.

Real drivers and simulated devices fulfil these alike; nothing else in the program knows which
one it talks to. Angles are the device's own degrees; `acquisition.engine.axis` maps them to the
rig's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8] | NDArray[np.uint16]
Surface = Literal["sample", "white tile"]


@dataclass(frozen=True, slots=True)
class Frame:
    """One picture: `image[row, column]` in counts (DN), its exposure and time of read-out.

    `device_time_s`: the camera's own time stamp, in seconds of the monotonic clock; None without.
    """

    image: Image
    exposure_s: float
    time_s: float
    device_time_s: float | None = None


@dataclass(frozen=True, slots=True)
class Request:
    """What the operator is asked to do, in words and in terms that a simulated scene can act on."""

    action: Literal["set axis", "place", "cover lamp", "uncover lamp"]
    text: str
    axis: str = ""
    angle_deg: float = 0.0
    surface: Surface = "sample"


class Operator(Protocol):
    """Somebody at the bench, or the simulated scene in their place."""

    def ask(self, request: Request) -> str:
        """Return the answer once the request is done; raise `OperatorStop` when it is refused."""
        ...


class Stage(Protocol):
    """One rotary axis, in the device's own degrees. Only absolute moves."""

    def identity(self) -> str:
        """Who answers: maker, model, serial number."""
        ...

    def home(self) -> None:
        """Find the reference; no motion is allowed before."""
        ...

    def homed(self) -> bool:
        """Whether it knows its reference, asked once it has come to rest.

        An axis that is set by hand always does.
        """
        ...

    def settings(self) -> dict[str, str]:
        """What it is set to, read back from it where it tells; units in the names."""
        ...

    def start_move(self, angle_deg: float) -> None:
        """Begin to move to `angle_deg`; returns at once."""
        ...

    def wait(self) -> float:
        """Wait until the move has ended and return the position in degrees."""
        ...

    def position_deg(self) -> float:
        """Where the stage is, also while it moves."""
        ...

    def limits_deg(self) -> tuple[float, float]:
        """The least and the largest angle that it will go to."""
        ...

    def stop(self) -> None:
        """End all motion now; safe at any time, twice, and from another thread."""
        ...

    def close(self) -> None:
        """Let go of the device; safe twice."""
        ...


class Camera(Protocol):
    """A camera that gives raw counts."""

    def identity(self) -> str:
        """Who answers: maker, model, serial number."""
        ...

    def settings(self) -> dict[str, str]:
        """What it is set to, read back from it where it tells; units in the names."""
        ...

    def set_exposure_s(self, exposure_s: float) -> float:
        """Set the exposure and return the one read back, in seconds."""
        ...

    def grab(self, count: int) -> list[Frame]:
        """Take `count` frames whose exposure began after this call."""
        ...

    def close(self) -> None:
        """Let go of the device; safe twice."""
        ...


class Lamp(Protocol):
    """The lamp, or the shutter or lid before it."""

    def identity(self) -> str:
        """Who answers, or who covers it."""
        ...

    def darken(self) -> None:
        """No light on the sample."""
        ...

    def light(self) -> None:
        """Full light on the sample."""
        ...
