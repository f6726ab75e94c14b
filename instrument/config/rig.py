"""Rig file: geometry, axes, camera and lamp of an instrument, with the unit in every name.

pydantic models; `instrument.config.load` reads them from YAML.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import Annotated, Literal, Self

from pydantic import Field, PrivateAttr

from instrument.calibration.geometry_file import GeometryCalibration
from instrument.config.axes import AXES, EMULATED, Axes, HandAxis, OphydAxis, SimulatedAxis, Wired
from instrument.config.camera import AnyCamera, CameraDefects, SimulatedCameraConfig
from instrument.config.section import Finite, Name, NotNegative, Positive, Section
from instrument.config.simulated.defects import (
    AxesDefects,
    LampDefects,
    LensDefects,
    Placement,
)
from instrument.config.simulated.spread import Share, Signed, Spread
from instrument.config.uncertainty.rig_lines import RigLines

_RANGES = ("theta_i_deg", "dphi_deg", "theta_r_deg")
Range = Annotated[list[Finite], Field(min_length=2, max_length=2)]


class KeepOut(Section):
    """Forbidden zone: a box of axis angles, or a cone around the direction of the lamp."""

    name: Name
    theta_i_deg: Range | None = None
    dphi_deg: Range | None = None
    theta_r_deg: Range | None = None
    camera_to_lamp_deg: Positive | None = None

    def mistakes(self) -> Iterator[tuple[str, str]]:
        """Require either a box or a cone, and the limits of each range in order."""
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
    """Lamp; a `shutter` darkens it, or the operator covers it by `hand`.

    A `manual` lamp is a real one without a driver. `white_electrons_per_s`: electrons that a pixel
    collects from a perfect white diffuser at normal incidence; it predicts the first exposure and
    the duration of a scan. `u_flicker`: relative standard deviation of the light from frame to
    frame. The default suits a lamp on a stabilised supply of direct current.
    """

    driver: Literal["simulated", "manual"]
    darkened_by: Literal["shutter", "hand"]
    shutter_s: NotNegative = 0.1
    cover_s: NotNegative = 15.0
    white_electrons_per_s: Positive
    u_flicker: Annotated[float, Field(ge=0, lt=1)] = 0.003

    def mistakes(self) -> Iterator[tuple[str, str]]:
        """Refuse a shutter on a manual lamp: no driver would operate it."""
        if self.driver == "manual" and self.darkened_by != "hand":
            yield "darkened_by", f"{self.darkened_by}; allowed for a manual lamp: hand"


class SimulatedTile(Section):
    """True radiance factor of the white tile on a simulated rig, which the protocol may not know.

    `at_normal` * (1 - `falloff` * ((1 - cos theta_i) + (1 - cos theta_r))
    + `forward` * sin^2 theta_i sin^2 theta_r (1 - cos dphi) / 2). Sintered PTFE is like 1.057, 0.18
    and 0.5, within 3 % up to theta_i 75 deg seen at 10 deg. `aged`: relative loss of all of it
    since its certificate.
    """

    at_normal: Annotated[float, Field(gt=0, le=2)] = 1.0
    falloff: Annotated[float, Field(ge=0, le=0.5)] = 0.0
    forward: Annotated[float, Field(ge=0, le=5)] = 0.0
    aged: Share = 0.0


class Simulation(Section):
    """Hidden properties of a simulated rig: noise seed, lamp drift, places, and all defects.

    `sample_height_mm`, `tile_height_mm`: distance of the surface from the rotation axis, towards
    the camera; that of the tile is added to an error of placement drawn from the seed.
    `lamp_drift_per_hour`: relative change of the lamp's output. `tile`: the white tile; without it,
    matt, and as reflecting as the protocol says, but for an error of its u. `channel_responses`: of
    the red, green and blue channel of a colour camera, relative to the electrons that the lamp is
    stated to give; all 1 if omitted. `wall_light`: light of the lamp that comes back from the
    surroundings, evenly from all directions: its irradiance relative to the lamp's at normal
    incidence. `drawn`: the sizes of the defects are drawn from the seed, with the spreads that the
    documentation of rig files lists.
    """

    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = 0
    drawn: bool = False
    sample_height_mm: Signed = 0.0
    tile_height_mm: Signed = 0.0
    lamp_drift_per_hour: Annotated[float, Field(gt=-1, lt=1), Spread.SIGNED] = 0.0
    background_reflectance: Annotated[float, Field(ge=0, le=1)] = 0.02
    wall_light: Share = 0.0
    camera_defects: CameraDefects = CameraDefects()
    lamp_defects: LampDefects = LampDefects()
    lens_defects: LensDefects = LensDefects()
    axis_defects: AxesDefects = AxesDefects()
    sample_placement: Placement = Placement()
    tile_placement: Placement = Placement()
    tile: SimulatedTile | None = None
    channel_responses: Annotated[list[Positive], Field(min_length=3, max_length=3)] | None = None

    def outside(self, width_px: int, height_px: int) -> Iterator[str]:
        """Yield the hot and dead pixels that lie outside an image of this size, in words."""
        defects = self.camera_defects
        for kind, pixels in (("hot", defects.hot_pixels), ("dead", defects.dead_pixels)):
            for pixel in pixels:
                if pixel.row >= height_px or pixel.column >= width_px:
                    yield (
                        f"{kind} pixel in row {pixel.row}, column {pixel.column}; allowed: rows up "
                        f"to {height_px - 1}, columns up to {width_px - 1}"
                    )


class Rig(Section):
    """Complete rig file.

    `geometry`: file of `gonio calibrate geometry`, beside the rig file. It gives the camera's
    `field_width_mm`, `axis_row_px`, `axis_column_px`, `roll_deg` and `distortion`, and `zero_deg`
    of theta_r with its `u_zero_theta_r_deg`.
    """

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
    uncertainty: RigLines = RigLines()
    simulation: Simulation = Simulation()
    geometry: Annotated[str, Field(min_length=1, max_length=1000)] | None = None
    _measured: GeometryCalibration | None = PrivateAttr(None)
    _typed: Rig | None = PrivateAttr(None)

    @property
    def measured(self) -> GeometryCalibration | None:
        """Content of the file `geometry`; None without one."""
        return self._measured

    @property
    def typed(self) -> Rig:
        """Rig as its file states it, without the calibration of its geometry."""
        return self._typed or self

    def with_geometry(self, measured: GeometryCalibration) -> Self:
        """Return a copy that takes the values of its `geometry`."""
        axis = self.axes.theta_r.with_zero(measured.zero_deg)
        u_deg = measured.u_zero_deg
        update = {
            "camera": self.camera.model_copy(
                update={**measured.camera_values(), "distortion": measured.distortion}
            ),
            "axes": self.axes.model_copy(update={"theta_r": axis}),
            "uncertainty": self.uncertainty.model_copy(update={"u_zero_theta_r_deg": u_deg}),
        }
        rig = self.model_copy(update=update)
        rig._measured, rig._typed = measured, self
        return rig

    def mistakes(self) -> Iterator[tuple[str, str]]:
        """Require all devices to be simulated, all emulated or all real: they share one scene."""
        kinds = dict(self._kinds())
        if len(set(kinds.values())) > 1:
            what = ", ".join(f"{name} is {kind}" for name, kind in kinds.items())
            yield "axes", f"{what}; allowed: all simulated, all emulated or all real"
        yield from self._port_conflicts()
        lines = self.uncertainty
        if self.camera.dark_patch is not None and (lines.stray_light or lines.u_stray_light):
            yield (
                "uncertainty",
                f"stray_light {lines.stray_light:g}, u_stray_light {lines.u_stray_light:g}; "
                "allowed with a dark_patch of the camera, which measures it: neither",
            )
        if self.simulation.channel_responses is not None and not self.camera.is_colour:
            yield (
                "simulation",
                "channel_responses beside a camera of one channel; allowed: with channels: 3",
            )
        for text in self.simulation.outside(self.camera.width_px, self.camera.height_px):
            yield "simulation", text

    def _port_conflicts(self) -> Iterator[tuple[str, str]]:
        """Require per port one kind of driver and line, and an address for each axis on it."""
        axes = {name: self.axes[name] for name in AXES}
        wired = {n: a for n, a in axes.items() if isinstance(a, Wired) and a.port != EMULATED}
        for (one, first), (other, second) in combinations(wired.items(), 2):
            if first.port != second.port:
                continue
            if first.driver != second.driver:
                text = f"{first.driver} and {second.driver}; allowed on one port: one driver"
                yield "axes", f"{one} and {other} are both at {first.port}, with {text}"
            elif first.line != second.line:
                text = f"with {first.line} and {second.line}; allowed on one port: the same"
                yield "axes", f"{one} and {other} are both at {first.port}, {text}"
            elif first.place == second.place:
                text = f"{first.place}; allowed: an address for each"
                yield "axes", f"{one} and {other} are both at {first.port}, {text}"

    def _kinds(self) -> Iterator[tuple[str, str]]:
        for name in AXES:
            axis = self.axes[name]
            if isinstance(axis, SimulatedAxis):
                yield f"axis {name}", "simulated"
            elif isinstance(axis, OphydAxis):
                yield f"axis {name}", "real"
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
        """Kind of all devices: "simulated", "emulated" or "real"."""
        return "simulated" if self.simulated else "emulated" if self.emulated else "real"

    @property
    def emulated(self) -> bool:
        """True if the real drivers are connected to emulated devices."""
        return not self.simulated and getattr(self.camera, "device", "") == EMULATED

    @property
    def simulated(self) -> bool:
        """True if the devices are simulated, without drivers."""
        return isinstance(self.camera, SimulatedCameraConfig)

    @property
    def real(self) -> bool:
        """True for real hardware; otherwise a simulated scene also answers the prompts."""
        return not self.simulated and not self.emulated
