"""Axes of a rig file: driver, limits, speed and uncertainty of each.

One class for each kind of driver; a kind that is not listed here is refused. The driver of an axis
matters only here, in `acquisition.rig`, and in the two modules that handle every member of `Wired`:
`drivers.factory` and `sim.emulated.bench`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field

from instrument.config.section import Finite, NotNegative, Positive, Section
from instrument.devices import REPLY_S

AXES = ("theta_i", "dphi", "theta_r")
AxisName = Literal["theta_i", "dphi", "theta_r"]
EMULATED = "emulated"
"""Value of `port` or `device` that connects the driver to an emulated device."""

LEAST_TOLERANCE_DEG = 0.01

Baudrate = Annotated[int, Field(ge=9600, le=921600)]

# pyserial knows more kinds of address; one of them, spy://, writes to any file.
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
    reports_while_moving: ClassVar[bool] = False
    """True for a driver that turns at a given speed and reports positions on the way."""

    min_deg: Finite
    max_deg: Finite
    zero_deg: Finite = 0.0
    sign: Literal[1, -1] = 1
    u_deg: NotNegative

    def mistakes(self) -> Iterator[tuple[str, str]]:
        """Require min_deg < max_deg."""
        if self.min_deg >= self.max_deg:
            yield "min_deg", f"{self.min_deg:g}; allowed: less than max_deg {self.max_deg:g}"

    def with_zero(self, zero_deg: float) -> Self:
        """Return the same axis whose device reads `zero_deg` at 0; no limit moves in the device."""
        by_deg = (self.zero_deg - zero_deg) * self.sign
        moved = ("min_deg", "max_deg", "home_deg")
        own = {key: getattr(self, key) + by_deg for key in moved if hasattr(self, key)}
        return self.model_copy(update={"zero_deg": zero_deg, **own})

    @property
    def tolerance_deg(self) -> float:
        """Largest allowed distance in degrees of a finished move from its target."""
        return max(3 * self.u_deg, LEAST_TOLERANCE_DEG)

    def to_device_deg(self, angle_deg: float) -> float:
        """Convert an angle of the rig to the device's own degrees."""
        return self.zero_deg + self.sign * angle_deg

    def from_device_deg(self, angle_deg: float) -> float:
        """Convert the device's own degrees to an angle of the rig."""
        return (angle_deg - self.zero_deg) * self.sign

    def device_limits_deg(self) -> tuple[float, float]:
        """Return the limits in the device's own degrees, the lower one first."""
        low, high = sorted(map(self.to_device_deg, (self.min_deg, self.max_deg)))
        return low, high


class HandAxis(_Axis):
    """Axis that the operator sets by hand, which takes `set_s` seconds."""

    driver: Literal["hand"]
    set_s: NotNegative = 60.0


class _MotorAxis(_Axis):
    """Motor; its device reads `zero_deg` when the axis is at 0.

    After homing, which takes up to `homing_s`, the axis is at `home_deg`.
    """

    reports_while_moving: ClassVar[bool] = True

    speed_deg_per_s: Positive
    acceleration_deg_per_s2: Positive
    settle_s: NotNegative
    backlash_deg: NotNegative = 0.0
    home_deg: Finite = 0.0
    homing_s: NotNegative = 5.0


class SimulatedAxis(_MotorAxis):
    """Simulated motor in simulated time, without a driver."""

    driver: Literal["simulated"]


class _WiredAxis(_MotorAxis):
    """Motor whose controller is connected to a port and answers within `reply_s`.

    Allow twice the longest time that a slow gateway or serial server takes: a moving stage is
    stopped when its last status is older than 0.5 s, or more by eight times what `reply_s`
    exceeds 0.15 s.
    """

    port: Port
    reply_s: Annotated[float, Field(ge=0.05, le=1.0)] = REPLY_S

    @property
    def place(self) -> str:
        """Address of the motor on its port, which several may share."""
        keys = ("address", "device", "axis", "unit")
        return " ".join(f"{key} {getattr(self, key)}" for key in keys if hasattr(self, key))

    @property
    def line(self) -> str:
        """Settings of its port, which all axes on it share."""
        keys = ("model", "baudrate", "parity", "reply_s")
        return " ".join(f"{key} {getattr(self, key)}" for key in keys if hasattr(self, key))


class NewportAxis(_WiredAxis):
    """Motor on a Newport SMC100 or CONEX-CC; prefer a /dev/serial/by-id path as `port`."""

    driver: Literal["newport"]
    model: Literal["SMC100", "CONEX-CC"] = "SMC100"
    address: Annotated[int, Field(ge=1, le=31)] = 1


class ZaberAxis(_WiredAxis):
    """Zaber stage; `microsteps_per_deg` is a constant of the stage (X-RSW60: 4266.667)."""

    driver: Literal["zaber"]
    device: Annotated[int, Field(ge=1, le=99)] = 1
    axis: Annotated[int, Field(ge=1, le=9)] = 1
    microsteps_per_deg: Positive
    baudrate: Baudrate = 115200


class OrientalAxis(_WiredAxis):
    """Motor on an Oriental Motor AZ drive with Modbus.

    `port`: a /dev/serial/by-id path for RTU, or tcp://host:port of a gateway. `steps_per_deg`
    depends on the gear and on the drive's electronic gear.
    """

    driver: Literal["oriental"]
    unit: Annotated[int, Field(ge=1, le=247)] = 1
    steps_per_deg: Positive
    baudrate: Baudrate = 115200
    parity: Literal["E", "N", "O"] = "E"


class OphydAxis(_MotorAxis):
    """Motor of another control system, as EPICS, by its class in ophyd-async: `module:Class`.

    `prefix`: of its address there, for a class that takes one. It counts in degrees and knows its
    reference.
    """

    reports_while_moving: ClassVar[bool] = False  # with which delay is not known

    driver: Literal["ophyd"]
    motor: Annotated[
        str,
        Field(
            max_length=200,
            pattern=r"^[A-Za-z_][A-Za-z0-9_.]*:[A-Za-z_][A-Za-z0-9_]*$",
            description="module:Class, such as ophyd_async.epics.motor:Motor",
        ),
    ]
    prefix: Annotated[str, Field(min_length=1, max_length=200)] | None = None


Wired = NewportAxis | ZaberAxis | OrientalAxis
MotorAxis = SimulatedAxis | OphydAxis | Wired
Axis = Annotated[
    HandAxis | SimulatedAxis | NewportAxis | ZaberAxis | OrientalAxis | OphydAxis,
    Field(discriminator="driver"),
]


class Axes(Section):
    """The three axes: theta_i and dphi position the lamp, theta_r the camera."""

    theta_i: Axis
    dphi: Axis
    theta_r: Axis

    def __getitem__(self, name: str) -> HandAxis | MotorAxis:
        axis: HandAxis | MotorAxis = getattr(self, name)
        return axis
