"""The rig file: what stands on the bench, in an operator's words and with units in every name.

pydantic models (strict, frozen, unknown keys refused); read them with `instrument.config`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

AXES = ("theta_i", "dphi", "theta_r")
AxisName = Literal["theta_i", "dphi", "theta_r"]

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Name = Annotated[str, Field(min_length=1, max_length=200)]


class Section(BaseModel):
    """A block of a configuration file: frozen, strict, without unknown keys."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    def mistakes(self) -> Iterator[tuple[str, str]]:
        """Values that do not go together: the key to point at, and what is wrong with it."""
        yield from ()

    @model_validator(mode="after")
    def _goes_together(self) -> Self:
        found = list(self.mistakes())
        if found:
            text = "; ".join(f"{key}: {what}" for key, what in found)
            raise PydanticCustomError("together", "{text}", {"text": text, "found": found})
        return self


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


class HandAxis(_Axis):
    """An axis that the operator sets by hand; `set_s` is how long that takes."""

    driver: Literal["hand"]
    set_s: NotNegative = 60.0


class SimulatedAxis(_Axis):
    """A simulated motor; its device reads zero_deg when the axis stands at 0.

    `home_deg` is where the axis stands after homing, which takes `homing_s`.
    """

    driver: Literal["simulated"]
    speed_deg_per_s: Positive
    acceleration_deg_per_s2: Positive
    settle_s: NotNegative
    backlash_deg: NotNegative = 0.0
    home_deg: Finite = 0.0
    homing_s: NotNegative = 5.0


Axis = Annotated[HandAxis | SimulatedAxis, Field(discriminator="driver")]


class Axes(Section):
    """The three axes: where the lamp stands (theta_i, dphi) and where the camera (theta_r)."""

    theta_i: Axis
    dphi: Axis
    theta_r: Axis

    def __getitem__(self, name: str) -> HandAxis | SimulatedAxis:
        axis: HandAxis | SimulatedAxis = getattr(self, name)
        return axis


_RANGES = ("theta_i_deg", "dphi_deg", "theta_r_deg")
Range = Annotated[list[Finite], Field(min_length=2, max_length=2)]


class KeepOut(Section):
    """Where no axis may pass: a box of axis angles, or a cone about the lamp's direction."""

    name: Name
    theta_i_deg: Range | None = None
    dphi_deg: Range | None = None
    theta_r_deg: Range | None = None
    camera_to_lamp_deg: Positive | None = None

    def mistakes(self) -> Iterator[tuple[str, str]]:
        """A box or a cone, and each range in order."""
        ranges = {key: getattr(self, key) for key in _RANGES}
        box = {key: pair for key, pair in ranges.items() if pair is not None}
        if bool(box) == (self.camera_to_lamp_deg is not None):
            yield (
                "name",
                f"{self.name!r} is {'both a box and a cone' if box else 'neither box nor cone'}; "
                f"allowed: either some of {', '.join(_RANGES)}, or camera_to_lamp_deg",
            )
        for key, (low, high) in box.items():
            if low > high:
                yield key, f"[{low:g}, {high:g}]; allowed: [low, high]"


class Camera(Section):
    """The camera on the beam: picture, electrons, exposure."""

    driver: Literal["simulated"]
    width_px: Annotated[int, Field(ge=16, le=16384)]
    height_px: Annotated[int, Field(ge=16, le=16384)]
    field_width_mm: Positive
    axis_row_px: Finite
    axis_column_px: Finite
    roll_deg: Annotated[float, Field(ge=-180, le=180)] = 0.0
    bit_depth: Annotated[int, Field(ge=8, le=16)]
    full_well_electrons: Positive
    read_noise_electrons: NotNegative
    dark_current_electrons_per_s: NotNegative
    black_level_dn: NotNegative = 0.0
    min_exposure_s: Positive
    max_exposure_s: Positive
    frame_overhead_s: NotNegative

    def mistakes(self) -> Iterator[tuple[str, str]]:
        """Exposures in order, the axis inside the picture, room above the black level."""
        if self.min_exposure_s > self.max_exposure_s:
            yield (
                "min_exposure_s",
                f"{self.min_exposure_s:g}; allowed: at most max_exposure_s {self.max_exposure_s:g}",
            )
        for key, size in (("axis_row_px", self.height_px), ("axis_column_px", self.width_px)):
            value = getattr(self, key)
            if not 0 <= value <= size - 1:
                yield key, f"{value:g} lies outside the picture; allowed: 0 to {size - 1}"
        if self.black_level_dn >= self.max_dn / 2:
            yield (
                "black_level_dn",
                f"{self.black_level_dn:g}; allowed: less than half of full scale, {self.max_dn} DN",
            )
        least = 4 * self.read_noise_electrons / self.electrons_per_dn
        if self.black_level_dn < least:
            yield (
                "black_level_dn",
                f"{self.black_level_dn:g}; allowed: at least {least:.3g}, 4 times the read noise "
                "in counts, or darks are cut off at 0",
            )

    @property
    def max_dn(self) -> int:
        """The largest count that a pixel can give."""
        return int(2**self.bit_depth - 1)

    @property
    def electrons_per_dn(self) -> float:
        """Conversion gain: the full well fills the counts above the black level."""
        return self.full_well_electrons / (self.max_dn - self.black_level_dn)


class Lamp(Section):
    """The lamp; `shutter` darkens it by itself, `hand` asks the operator to cover it.

    `white_electrons_per_s`: what a pixel collects from a perfect white diffuser lit at normal
    incidence: from it the first exposure and the duration of a scan are predicted.
    """

    driver: Literal["simulated"]
    darkened_by: Literal["shutter", "hand"]
    shutter_s: NotNegative = 0.1
    cover_s: NotNegative = 15.0
    white_electrons_per_s: Positive


class Simulation(Section):
    """What a simulated rig has and nobody tells the operator: seed, drift, a sample off the axis.

    `sample_height_mm`: how far the surface stands off the rotation axis, towards the camera.
    `lamp_drift_per_hour`: relative change of the lamp's output.
    """

    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = 0
    sample_height_mm: Finite = 0.0
    lamp_drift_per_hour: Annotated[float, Field(gt=-1, lt=1)] = 0.0
    background_reflectance: Annotated[float, Field(ge=0, le=1)] = 0.02


class Rig(Section):
    """A whole rig file."""

    name: Name
    description: str = ""
    beam_length_mm: Positive
    lamp_distance_mm: Positive
    source_solid_angle_sr: Annotated[float, Field(ge=0, le=1)]
    receiver_solid_angle_sr: Annotated[float, Field(ge=0, le=1)]
    blocked_half_angle_deg: Annotated[float, Field(gt=0, lt=90)] | None = None
    u_placement_mm: NotNegative = 0.0
    swap_s: NotNegative = 60.0
    axes: Axes
    keep_out: list[KeepOut] = []
    camera: Camera
    lamp: Lamp
    simulation: Simulation = Simulation()

    @property
    def simulated(self) -> bool:
        """Whether the scene is simulated: then it also answers the operator's prompts."""
        return self.camera.driver == "simulated"
