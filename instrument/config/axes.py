"""The axes of a rig file: what drives each, within which limits, how fast, how well.

The driver of an axis matters only here, in `acquisition.rig`, and in the two modules that handle
every member of `Wired`: `drivers.factory` and `sim.emulated.bench`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

from instrument.config.section import Finite, NotNegative, Positive, Section

AXES = ("theta_i", "dphi", "theta_r")
AxisName = Literal["theta_i", "dphi", "theta_r"]
EMULATED = "emulated"
"""In place of a port or a device: the driver talks to an emulated one, over the simulated scene."""

LEAST_TOLERANCE_DEG = 0.01

# pyserial has more kinds of address, of which one writes to any file that it names (spy://).
Port = Annotated[
    str,
    Field(
        min_length=1,
        max_length=200,
        pattern=r"^(/[^\n\t]*|[^:\n\t]*|(socket|rfc2217|tcp)://[^\n\t]*)$",
        description="a device's path, socket://host:port, rfc2217://host:port or tcp://host:port",
    ),
]


class _Axis(Section):
    min_deg: Finite
    max_deg: Finite
    zero_deg: Finite = 0.0
    sign: Literal[1, -1] = 1
    u_deg: NotNegative

    def mistakes(self) -> Iterator[tuple[str, str]]:
        """The limits stand in order."""
        if self.min_deg >= self.max_deg:
            yield "min_deg", f"{self.min_deg:g}; allowed: less than max_deg {self.max_deg:g}"

    @property
    def tolerance_deg(self) -> float:
        """How far from its target a move may end."""
        return max(3 * self.u_deg, LEAST_TOLERANCE_DEG)

    def to_device_deg(self, angle_deg: float) -> float:
        """An angle of the rig in the device's own degrees."""
        return self.zero_deg + self.sign * angle_deg

    def from_device_deg(self, angle_deg: float) -> float:
        """The device's own degrees as an angle of the rig."""
        return (angle_deg - self.zero_deg) * self.sign

    def device_limits_deg(self) -> tuple[float, float]:
        """The limits in the device's own degrees, the lower first."""
        low, high = sorted(map(self.to_device_deg, (self.min_deg, self.max_deg)))
        return low, high


class HandAxis(_Axis):
    """An axis that the operator sets by hand; `set_s` is how long that takes."""

    driver: Literal["hand"]
    set_s: NotNegative = 60.0


class _MotorAxis(_Axis):
    """A motor; its device reads zero_deg when the axis stands at 0.

    `home_deg` is where the axis stands after homing, which takes up to `homing_s`.
    """

    speed_deg_per_s: Positive
    acceleration_deg_per_s2: Positive
    settle_s: NotNegative
    backlash_deg: NotNegative = 0.0
    home_deg: Finite = 0.0
    homing_s: NotNegative = 5.0


class SimulatedAxis(_MotorAxis):
    """A motor that is simulated as a whole, in simulated time."""

    driver: Literal["simulated"]


class NewportAxis(_MotorAxis):
    """A motor behind Newport's SMC100 or CONEX-CC; `port` is best a /dev/serial/by-id path."""

    driver: Literal["newport"]
    port: Port
    model: Literal["SMC100", "CONEX-CC"] = "SMC100"
    address: Annotated[int, Field(ge=1, le=31)] = 1

    @property
    def place(self) -> str:
        """Which of the devices on the port."""
        return f"address {self.address}"


class ZaberAxis(_MotorAxis):
    """A Zaber stage; `microsteps_per_deg` is the stage's own (X-RSW60: 4266.667)."""

    driver: Literal["zaber"]
    port: Port
    device: Annotated[int, Field(ge=1, le=99)] = 1
    axis: Annotated[int, Field(ge=1, le=9)] = 1
    microsteps_per_deg: Positive

    @property
    def place(self) -> str:
        """Which of the devices on the port, and which axis of it."""
        return f"device {self.device} axis {self.axis}"


class OrientalAxis(_MotorAxis):
    """A motor behind Oriental Motor's AZ drive, Modbus.

    `port`: a /dev/serial/by-id path for RTU, or tcp://host:port of a gateway. `steps_per_deg`
    follows from the gear and the drive's electronic gear.
    """

    driver: Literal["oriental"]
    port: Port
    unit: Annotated[int, Field(ge=1, le=247)] = 1
    steps_per_deg: Positive
    baudrate: Annotated[int, Field(ge=9600, le=921600)] = 115200
    parity: Literal["E", "N", "O"] = "E"

    @property
    def place(self) -> str:
        """Which of the devices on the port."""
        return f"unit {self.unit}"


Wired = NewportAxis | ZaberAxis | OrientalAxis
MotorAxis = SimulatedAxis | Wired
Axis = Annotated[
    HandAxis | SimulatedAxis | NewportAxis | ZaberAxis | OrientalAxis,
    Field(discriminator="driver"),
]


class Axes(Section):
    """The three axes: where the lamp stands (theta_i, dphi) and where the camera (theta_r)."""

    theta_i: Axis
    dphi: Axis
    theta_r: Axis

    def __getitem__(self, name: str) -> HandAxis | MotorAxis:
        axis: HandAxis | MotorAxis = getattr(self, name)
        return axis
