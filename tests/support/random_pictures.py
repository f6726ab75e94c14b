"""Pictures of random samples on random rigs, with errors as large as their uncertainties say."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from acquisition.interlocks.picture.outline import Deviation
from acquisition.interlocks.picture.outline_check import U_TILT_DEG, OutlineCheck
from acquisition.plan.plan import Step
from acquisition.plan.pose import Pose
from instrument.config.load import Loaded, load_protocol
from instrument.config.protocol import PatchConfig, Protocol, Sample
from instrument.config.rig import Rig
from instrument.config.simulated.sample import SimulatedSample
from instrument.devices import Image, Surface
from instrument.pinhole import Pinhole
from instrument.record.reading import Kind
from sim.defects.world import World
from sim.scene.scene import Scene
from sim.scene.sensor import Sensor
from tests.support.paths import CONFIGS


@dataclass(frozen=True)
class Picture:
    """Rig and protocol as written in their files, and the scene as it is.

    theta_r_deg: where the stage says that it is. exposure_s: of the picture.
    """

    rig: Rig
    protocol: Protocol
    scene: Scene
    theta_r_deg: float
    exposure_s: float

    @property
    def check(self) -> OutlineCheck:
        return OutlineCheck.of(self.rig, self.protocol)

    def take(self) -> Image:
        return Sensor(self.scene).picture(self.exposure_s)

    def at(self, theta_r_deg: float, slip_deg: float = 0.0) -> Picture:
        """The same surface as seen from another angle; `slip_deg` beyond what the stage says."""
        self.scene.set_axis("theta_r", theta_r_deg)
        self.scene.true_deg["theta_r"] += slip_deg
        return replace(self, theta_r_deg=theta_r_deg)


def step_at(surface: Surface, pose: Pose, index: int = 0, kind: Kind = "drift") -> Step:
    """A step of a plan at this pose."""
    return Step(
        index=index, kind=kind, surface=surface, pose=pose, lamp_setting=0, block=0, frames=1,
        expected_exposure_s=0.01,
    )  # fmt: skip


@cache
def _loaded(rig: str) -> Loaded:
    return load_protocol(CONFIGS / "protocols" / "demo.yaml", CONFIGS / "rigs" / f"{rig}.yaml")


def random_picture(seed: int) -> Picture:
    """Draw a rig, a sample, a pose and an exposure; then the scene with its hidden errors."""
    rng = np.random.default_rng(seed)
    rig, protocol = _random_rig(rng), _random_protocol(rng)
    pose = {"theta_r": rng.uniform(-82, 82), "theta_i": rng.uniform(0, 75),
            "dphi": rng.uniform(0, 180)}  # fmt: skip
    u = OutlineCheck.of(rig, protocol).u["sample"]
    scene = Scene.of(_real_rig(rig, u, pose["theta_r"], rng), _real_protocol(protocol, rng))
    for axis, angle in pose.items():
        scene.set_axis(axis, angle)
    scene.heights_mm["sample"] = rig.u_placement_mm * rng.standard_normal()
    turn_deg, tilt_deg, shift_mm = rng.standard_normal(3) * [u.turn_deg, U_TILT_DEG, u.x_mm]
    scene.world = World(
        turn_deg=float(turn_deg), tilt_deg=float(tilt_deg), shift_mm=float(shift_mm)
    )
    scene.begin_step(int(rng.integers(1000)), 0.0)
    level = rig.lamp.white_electrons_per_s * np.cos(np.radians(pose["theta_i"]))
    exposure_s = 10 ** rng.uniform(-1.7, 0.7) * rig.camera.full_well_electrons / level
    return Picture(rig, protocol, scene, pose["theta_r"], float(exposure_s))


def _random_rig(rng: np.random.Generator) -> Rig:
    rig = _loaded(str(rng.choice(["bench_12bit", "paper_1995"]))).rig
    width = int(rng.integers(160, 480))
    height = int(width * rng.uniform(0.7, 1.0))
    camera = rig.camera.model_copy(
        update={
            "width_px": width,
            "height_px": height,
            "field_width_mm": rng.uniform(40, 150),
            "axis_column_px": width / 2 + 0.03 * width * rng.standard_normal(),
            "axis_row_px": height / 2 + 0.03 * height * rng.standard_normal(),
            "roll_deg": float(rng.choice([0, 0, 90, 180]) + 2 * rng.standard_normal()),
        }
    )
    seed, table = int(rng.integers(2**31)), rng.uniform(0, 0.6)
    simulation = rig.simulation.model_copy(update={"seed": seed, "background_reflectance": table})
    return rig.model_copy(
        update={
            "camera": camera,
            "simulation": simulation,
            "beam_length_mm": rng.uniform(400, 2000),
        }
    )


def _random_protocol(rng: np.random.Generator) -> Protocol:
    width, height = rng.uniform(20, 90, 2)
    sample = Sample(name="sample", width_mm=width, height_mm=height)
    share = rng.uniform(0.1, 0.95)
    window = PatchConfig(width_mm=share * width, height_mm=share * height)
    gloss = {"sigma_deg": rng.uniform(8, 30), "ks": rng.uniform(0, 0.5)}
    glossy = rng.uniform() < 0.2
    model = "lambert+torrance_sparrow" if glossy else "lambert"
    parameters = {"albedo": float(10 ** rng.uniform(-1.7, 0)), **(gloss if glossy else {})}
    simulated = SimulatedSample(
        model=model,
        parameters=parameters,
        mottling=float(rng.choice([0.0, 0.02, 0.1, 0.15])),
        mottling_size_mm=10 ** rng.uniform(-0.5, 1),
    )
    return _loaded("bench_12bit").protocol.model_copy(
        update={"sample": sample, "window": window, "simulated_sample": simulated}
    )


def _real_rig(rig: Rig, u: Deviation, theta_r_deg: float, rng: np.random.Generator) -> Rig:
    """The rig with an inexact scale, and the axis in the picture where the sample really lies."""
    field_mm = rig.camera.field_width_mm * (1 + u.field * rng.standard_normal())
    pinhole = Pinhole.of(rig)
    placed_mm = [0.0, u.y_mm * rng.standard_normal()]
    off_px = pinhole.project(placed_mm, theta_r_deg) - pinhole.project([0.0, 0.0], theta_r_deg)
    real = rig.camera.model_copy(
        update={
            "field_width_mm": float(field_mm),
            "axis_column_px": float(rig.camera.axis_column_px + off_px[0]),
            "axis_row_px": float(rig.camera.axis_row_px + off_px[1]),
            "roll_deg": float(rig.camera.roll_deg + u.roll_deg * rng.standard_normal()),
        }
    )
    return rig.model_copy(update={"camera": real})


def _real_protocol(protocol: Protocol, rng: np.random.Generator) -> Protocol:
    sample = protocol.sample
    size = {key: getattr(sample, key) + 0.5 * rng.standard_normal()
            for key in ("width_mm", "height_mm")}  # fmt: skip
    return protocol.model_copy(update={"sample": sample.model_copy(update=size)})
