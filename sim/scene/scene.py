"""State of the simulated rig: mounted surface, true angles, lamp level and random streams.

Simulated stages and the simulated operator change it; the simulated camera renders it. Each random
stream is keyed by the rig's seed and by what it belongs to (an axis and an angle; a step of the
plan and a frame), never by the number of calls, and the lamp drifts with the scan's own time, in
which interruptions do not count. The same protocol therefore gives the same bytes, whether the scan
ran in one go or was resumed.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import get_args

import cv2
import numpy as np

from analysis.accuracy.render_brdf import adequate_brdf
from analysis.models import MODELS
from instrument.board import Board
from instrument.clock import Clock
from instrument.config.camera import DarkPatch
from instrument.config.protocol import Markers, PatchConfig, Protocol, Sample, WhiteTile
from instrument.config.rig import Rig
from instrument.config.simulated.defects import Placement
from instrument.config.simulated.sample import SimulatedSample
from instrument.devices import BoardPlace, Surface
from instrument.geometry import Brdf, FloatArray, IntArray
from sim.clock import SimulatedClock
from sim.defects.drawn_bench import drawn_bench
from sim.defects.lamp import warm_up_level
from sim.defects.mechanics import (
    SeenAngles,
    axis_error_deg,
    half_turned,
    leaning,
    leaning_across,
    picture_shift,
    placement,
)
from sim.defects.polarisation import polarised
from sim.defects.tile import radiance_factor
from sim.defects.world import SOUND, World

# Place of an axis before it is first set by hand: no picture counts yet, but a dark may show light.
_UNSET_DEG = {"theta_i": 30.0, "dphi": 0.0, "theta_r": 0.0}


_NODES = -(0.6**0.5), 0.0, 0.6**0.5  # Gauss-Legendre, of an exposure from -1 to 1
NODE_WEIGHTS = 5 / 18, 8 / 18, 5 / 18
BOARD_PLACES = get_args(BoardPlace)
_ROUNDS = 8  # of the search for a standard deviation: exact to 1e-6 at 0.3
_LINEAR = 1e-6  # standard deviation below which a logarithm is as good as linear
PAPER = 0.8  # reflectance of white paper (assumed)


def stream_key(name: str) -> int:
    """Return a stable integer for `name`, to key a random stream with."""
    return zlib.crc32(name.encode())


def log_normal(normal: FloatArray, deviation: float) -> FloatArray:
    """Return relative variation of mean 0 and standard deviation `deviation`, nowhere below -1.

    Its logarithm plus 1 is proportional to `normal` (...), of mean 0 and standard deviation 1.
    """
    if deviation < _LINEAR:
        return deviation * normal
    spread = np.sqrt(np.log1p(deviation**2))  # exact for infinitely many normal deviates
    for _ in range(_ROUNDS):
        factor = np.exp(spread * normal)
        factor /= factor.mean()
        spread *= deviation / factor.std()
    return np.asarray(factor - 1)


@dataclass(slots=True)
class Scene:
    """Mounted surface, lamp and axes at one moment of a scan.

    sample: reflectance of the sample. sample_size: its extent. patch: its part that is measured.
    true_deg: true angle of each axis in degrees; it differs from the commanded one by the axis
    error. clock: by which the lamp drifts. rings: see `sim.scene.render`; cache of the averaging
    needed for each place of the lamp. heights_mm: height of each surface above the rotation axis;
    that of the tile is drawn from the rig's uncertainty of placement; a board lies as the sample
    does. motions: angle of each axis that moves, by the clock's time. world: faults that no device
    reports. board: that which the operator may put there. markers: on the plate of the sample.
    """

    rig: Rig
    sample: SimulatedSample
    sample_size: Sample
    patch: PatchConfig
    white_tile: WhiteTile | None
    surface: Surface | BoardPlace = "sample"
    lit: bool = True
    step: int = 0
    clock: Clock = field(default_factory=SimulatedClock)
    true_deg: dict[str, float] = field(default_factory=dict)
    motions: dict[str, Callable[[float], float]] = field(default_factory=dict)
    rings: dict[tuple[str, float, float], IntArray] = field(default_factory=dict)
    world: World = SOUND
    board: Board = field(default_factory=Board)
    markers: Markers | None = None
    _texture: FloatArray | None = None
    heights_mm: dict[Surface | BoardPlace, float] = field(init=False)
    _lamp_start_s: float = 0.0

    def __post_init__(self) -> None:
        self.rig = drawn_bench(self.rig)
        tile_mm = self.rig.u_placement_mm * self.random(stream_key("tile height")).standard_normal()
        simulation = self.rig.simulation
        self.heights_mm = {
            "sample": simulation.sample_height_mm,
            "board": simulation.sample_height_mm,
            "turned board": simulation.sample_height_mm,
            "white tile": float(tile_mm) + simulation.tile_height_mm,
        }

    @classmethod
    def of(cls, rig: Rig, protocol: Protocol) -> Scene:
        """Return the scene of a protocol; raise `ValueError` if it has no `simulated_sample`."""
        if protocol.simulated_sample is None:
            raise ValueError("the protocol has no simulated_sample: describe the sample")
        tile = protocol.references.white_tile
        return cls(
            rig, protocol.simulated_sample, protocol.sample, protocol.window, tile,
            markers=protocol.markers,
        )  # fmt: skip

    @classmethod
    def of_white_sample(cls, rig: Rig, size_mm: float = 50.0) -> Scene:
        """Return a scene for setting a rig up: a matt white square with sides of `size_mm`."""
        return cls(
            rig,
            SimulatedSample(model="lambert", parameters={"albedo": 0.9}),
            Sample(name="white", width_mm=size_mm, height_mm=size_mm),
            PatchConfig(width_mm=20.0, height_mm=20.0),
            None,
        )

    def use_clock(self, clock: Clock) -> None:
        """Let the lamp drift by this clock, from now on."""
        self.clock = clock
        self.begin_step(self.step, 0.0)

    def begin_step(self, step: int, scan_s: float) -> None:
        """Select the noise of the plan's step `step`, and set the lamp's age.

        scan_s: seconds since the start of the scan, without interruptions.
        """
        self.step, self._lamp_start_s = step, self.clock.now_s() - scan_s

    def random(self, *key: int) -> np.random.Generator:
        """Return the random stream that belongs to `key` and the rig's seed."""
        return np.random.Generator(np.random.SFC64([self.rig.simulation.seed, *key]))

    def set_axis(self, axis: str, angle_deg: float) -> None:
        """Set an axis to `angle_deg` (rig angle); the true angle differs by a random axis error.

        The error has the axis's standard uncertainty and depends on the angle only, like the
        cyclic error of a real stage: returning to an angle gives the same true angle.
        """
        error_deg = self._random_error_deg(axis, angle_deg) + self._lasting_deg(axis, angle_deg)
        self.true_deg[axis] = float(angle_deg + error_deg)

    def _random_error_deg(self, axis: str, angle_deg: float) -> float:
        key = round(angle_deg * 1e4) % 2**32
        drawn = self.random(stream_key(axis), key).standard_normal()
        return float(self.rig.axes[axis].u_deg * drawn)

    def _lasting_deg(self, axis: str, angle_deg: float) -> float:
        phase = float(self.random(stream_key(f"cycle of {axis}")).random())
        return axis_error_deg(angle_deg, self.rig.simulation.axis_defects[axis], phase)

    def push(self, axis: str, by_deg: float) -> None:
        """Turn an axis that moves by `by_deg` beyond what its motor does."""
        motion = self.motions.get(axis)
        if motion is not None:
            self.motions[axis] = lambda time_s: motion(time_s) + by_deg

    def poses_during(self, begin_s: float, exposure_s: float) -> tuple[dict[str, float], ...]:
        """Return the true angles at the nodes of an exposure; one pose where nothing moves.

        begin_s: by the clock. The mean over the nodes is that over the exposure, exact for
        polynomials up to degree 5 (Gauss-Legendre).
        """
        if not self.motions:
            return (self.true_deg,)
        times_s = [begin_s + exposure_s * (1 + node) / 2 for node in _NODES]
        return tuple(self.true_deg | self._moving_deg(time_s) for time_s in times_s)

    def _moving_deg(self, time_s: float) -> dict[str, float]:
        """Return the true angles of the axes that move.

        The random errors vary smoothly from one whole degree, where they are those of an axis at
        rest, to the next.
        """
        true_deg = {}
        for axis, motion in self.motions.items():
            angle_deg = motion(time_s)
            low_deg = float(np.floor(angle_deg))
            share = angle_deg - low_deg
            ends = [self._random_error_deg(axis, low_deg + n) for n in (0.0, 1.0)]
            error_deg = float(np.dot([1 - share, share], ends) / np.hypot(1 - share, share))
            true_deg[axis] = angle_deg + error_deg + self._lasting_deg(axis, angle_deg)
        return true_deg

    @property
    def mounted(self) -> Surface | BoardPlace | None:
        """Surface on the table: the one that was asked for, unless the world is at fault."""
        if self.world.mounted == "nothing":
            return None
        return self.surface if self.world.mounted == "as asked" else self.world.mounted

    @property
    def placement(self) -> Placement:
        """Place of the mounted surface on the table, without the faults of the moment."""
        simulation = self.rig.simulation
        if self.mounted == "turned board":
            return half_turned(simulation.sample_placement)
        tile = self.mounted == "white tile"
        return simulation.tile_placement if tile else simulation.sample_placement

    def placement_matrix(self) -> FloatArray:
        """Return the matrix (3, 3) from points (x, y, 1), in mm, of the surface to the table."""
        own = self.placement
        return placement(own.shift_x_mm, own.shift_y_mm, own.turn_deg) @ self.world.placement()

    def picture_shift(self) -> FloatArray:
        """Return the matrix (3, 3) by which the camera's beam moves pixels (column, row, 1)."""
        phase = float(self.random(stream_key("wobble of theta_r")).random())
        beam = self.rig.simulation.axis_defects.theta_r
        return picture_shift(self.table_angles().theta_r, beam, phase)

    def table_angles(self) -> SeenAngles:
        """Return the true angles of the axes, with all faults."""
        true_deg = {**_UNSET_DEG, **self.true_deg}
        return SeenAngles(**{n: a + getattr(self.world, f"{n}_deg") for n, a in true_deg.items()})

    def in_plane_angles(self) -> SeenAngles:
        """Return the angles from the normal of the surface, as far as it leans in x."""
        return leaning(self.table_angles(), self.world.tilt_deg + self.placement.tilt_deg)

    def seen_angles(self) -> SeenAngles:
        """Return the angles from the normal of the surface."""
        return leaning_across(self.in_plane_angles(), self.placement.tilt_across_deg)

    def seen_brdf(self) -> Brdf:
        """Return the BRDF as the polarisation of lamp and camera show it.

        Of geometries of any shape, in 1/sr, as in `brdf`.
        """
        if self.mounted != "sample":
            return self.brdf()
        simulation = self.rig.simulation
        lamp, lens = simulation.lamp_defects.polarisation, simulation.lens_defects.polarisation
        return polarised(self.brdf(), self.sample, self.seen_angles(), lamp=lamp, camera=lens)

    def brdf(self) -> Brdf:
        """Return the BRDF of the mounted surface, for natural light.

        The function takes a `Geometry` of any shape and returns an array of that shape in 1/sr.
        """
        if self.mounted == "sample":
            if self.sample.method == "auto":
                return adequate_brdf(self.sample.model, self.sample.parameters)
            model, parameters = MODELS[self.sample.model], self.sample.parameters
            return lambda geometry: model.brdf(geometry, **parameters)
        if self.mounted in BOARD_PLACES:
            return lambda geometry: MODELS["lambert"].brdf(geometry, albedo=PAPER)
        tile = self.rig.simulation.tile
        if tile is not None:
            return lambda geometry: radiance_factor(geometry, tile) / np.pi
        albedo = self.tile_reflectance()
        return lambda geometry: MODELS["lambert"].brdf(geometry, albedo=albedo)

    @property
    def size_mm(self) -> tuple[float, float]:
        """Width and height of the mounted surface; a tile of unstated size is like the sample."""
        if self.mounted in BOARD_PLACES:
            return self.board.size_mm
        tile = self.white_tile if self.mounted == "white tile" else None
        if tile is None or tile.width_mm is None or tile.height_mm is None:
            return self.sample_size.width_mm, self.sample_size.height_mm
        return tile.width_mm, tile.height_mm

    def tile_reflectance(self) -> float:
        """Return the white tile's true reflectance: the certified one plus a random error."""
        tile = self.white_tile
        if tile is None or tile.reflectance is None or tile.u_reflectance is None:
            raise ValueError("the reflectance of a white tile is asked for, but there is none")
        error = tile.u_reflectance * self.random(stream_key("white tile")).standard_normal()
        return float(min(1.0, tile.reflectance + error))

    def patch_reflectance(self, patch: DarkPatch) -> float:
        """Return the true radiance factor of the dark patch: the stated one plus a random error."""
        error = patch.u_reflectance * self.random(stream_key("dark patch")).standard_normal()
        return float(max(0.0, patch.reflectance + error))

    def age_s(self) -> float:
        """Return the time since the start of the scan, in seconds, without interruptions."""
        return self.clock.now_s() - self._lamp_start_s

    def lamp_level(self) -> float:
        """Return the lamp's output now, relative to a warm lamp at the start of the scan."""
        simulation, age_s = self.rig.simulation, self.age_s()
        steady = 1.0 + simulation.lamp_drift_per_hour * age_s / 3600.0
        return steady * warm_up_level(age_s, simulation.lamp_defects)

    def mottling(self) -> tuple[FloatArray, float]:
        """Return the sample's relative albedo variation (rows, columns), mean 0, and its spacing.

        The spacing of the grid points is in mm.
        """
        size = self.sample_size
        spacing_mm = self.sample.mottling_size_mm / 3.0
        rows = int(np.ceil(size.height_mm / spacing_mm)) + 1
        columns = int(np.ceil(size.width_mm / spacing_mm)) + 1
        if self.mounted != "sample" or self.sample.mottling == 0:
            return np.zeros((rows, columns)), spacing_mm
        if self._texture is None:
            self._texture = self._make_texture(rows, columns)
        return self._texture, spacing_mm

    def _make_texture(self, rows: int, columns: int) -> FloatArray:
        """White noise smoothed to patches of `mottling_size_mm` (three grid points)."""
        white = self.random(stream_key("mottling")).standard_normal((rows, columns))
        smooth = cv2.GaussianBlur(white, (0, 0), 1.5, borderType=cv2.BORDER_REFLECT)
        return log_normal((smooth - smooth.mean()) / smooth.std(), self.sample.mottling)
