"""The rig file: what stands on the bench, in an operator's words and with units in every name.

pydantic models (strict, frozen, unknown keys refused); read them with `instrument.config.load`.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import Annotated, Literal

from pydantic import Field

from instrument.config.axes import AXES, EMULATED, Axes, HandAxis, SimulatedAxis, Wired
from instrument.config.camera import AnyCamera, SimulatedCameraConfig
from instrument.config.section import Finite, Name, NotNegative, Positive, Section

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


class LampConfig(Section):
    """The lamp; `shutter` darkens it by itself, `hand` asks the operator to cover it.

    A `manual` lamp is a real one that a person serves.

    `white_electrons_per_s`: what a pixel collects from a perfect white diffuser lit at normal
    incidence: from it the first exposure and the duration of a scan are predicted.
    """

    driver: Literal["simulated", "manual"]
    darkened_by: Literal["shutter", "hand"]
    shutter_s: NotNegative = 0.1
    cover_s: NotNegative = 15.0
    white_electrons_per_s: Positive

    def mistakes(self) -> Iterator[tuple[str, str]]:
        """A real lamp has no shutter that this program could drive."""
        if self.driver == "manual" and self.darkened_by != "hand":
            yield "darkened_by", f"{self.darkened_by}; allowed for a manual lamp: hand"


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
    keep_out: list[KeepOut] = Field(default_factory=list)
    camera: AnyCamera
    lamp: LampConfig
    simulation: Simulation = Simulation()

    def mistakes(self) -> Iterator[tuple[str, str]]:
        """One scene for all: simulated, emulated or real devices do not mix."""
        kinds = dict(self._kinds())
        if len(set(kinds.values())) > 1:
            what = ", ".join(f"{name} is {kind}" for name, kind in kinds.items())
            yield "axes", f"{what}; allowed: all simulated, all emulated or all real"
        yield from self._ports_at_odds()

    def _ports_at_odds(self) -> Iterator[tuple[str, str]]:
        """Axes on one port: of one kind, each at an address of its own."""
        axes = {name: self.axes[name] for name in AXES}
        wired = {n: a for n, a in axes.items() if isinstance(a, Wired) and a.port != EMULATED}
        for (one, first), (other, second) in combinations(wired.items(), 2):
            if first.port != second.port:
                continue
            if first.driver != second.driver:
                text = f"{first.driver} and {second.driver}; allowed on one port: one driver"
                yield "axes", f"{one} and {other} are both at {first.port}, with {text}"
            elif first.place == second.place:
                text = f"{first.place}; allowed: an address for each"
                yield "axes", f"{one} and {other} are both at {first.port}, {text}"

    def _kinds(self) -> Iterator[tuple[str, str]]:
        for name in AXES:
            axis = self.axes[name]
            if isinstance(axis, SimulatedAxis):
                yield f"axis {name}", "simulated"
            elif not isinstance(axis, HandAxis):
                yield f"axis {name}", "emulated" if axis.port == EMULATED else "real"
        if isinstance(self.camera, SimulatedCameraConfig):
            yield "camera", "simulated"
        else:
            yield "camera", "emulated" if self.camera.device == EMULATED else "real"
        if (self.lamp.driver == "manual") != self.real:
            yield "lamp", "real" if self.lamp.driver == "manual" else "simulated"

    @property
    def kind(self) -> str:
        """In a word: simulated, emulated or real."""
        return "simulated" if self.simulated else "emulated" if self.emulated else "real"

    @property
    def emulated(self) -> bool:
        """Whether real drivers talk to emulated devices."""
        return not self.simulated and getattr(self.camera, "device", "") == EMULATED

    @property
    def simulated(self) -> bool:
        """Whether the devices are simulated as a whole."""
        return isinstance(self.camera, SimulatedCameraConfig)

    @property
    def real(self) -> bool:
        """Whether there is a bench; else a simulated scene, which also answers the prompts."""
        return not self.simulated and not self.emulated
