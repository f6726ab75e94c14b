"""Random short scans on all rigs: samples, angles, references, frames, lamps and cameras."""

from __future__ import annotations

import zlib
from functools import cache

import numpy as np
import yaml

from acquisition.plan.plan import make_plan
from instrument.config.camera import CameraDefects, HotPixel
from instrument.config.load import Loaded, load_protocol
from instrument.config.protocol import DriftCheck, PatchConfig, References, WhiteTile
from instrument.config.rig import Rig
from instrument.config.simulated.sample import SimulatedSample
from sim.faults.faults import Faults
from tests.support.paths import CONFIGS
from tests.support.scans import changed, shrunk
from tests.support.whole_scans.simulated_rig import simulated

RIGS = ("bench_12bit", "paper_1995", "emulated")
KINDS = ("matt", "gloss", "dark", "ggx")
_TILE_MM = 40.0


@cache
def _base(rig: str) -> Loaded:
    """The demonstration on a rig file, the emulated one with simulated devices."""
    demo = load_protocol(CONFIGS / "protocols" / "demo.yaml")
    text = (CONFIGS / "rigs" / f"{rig}.yaml").read_text()
    text = simulated(text) if rig == "emulated" else text
    return changed(demo, rig=dict(Rig.model_validate(yaml.safe_load(text))))


def random_scan(
    rig: str, seed: int, *, shrink: int = 1, kind: str | None = None, least_frames: int = 1
) -> Loaded:
    """Return a scan of 7 to 18 geometries drawn from `seed`; of a tile and with drift checks.

    With an even seed the tile is read again at the end of each setting of the lamp by hand.
    kind: of the sample, one of `KINDS`. shrink: rows and columns of the camera are divided by it.
    """
    random = np.random.default_rng([seed, zlib.crc32(rig.encode())])
    base = shrunk(_base(rig), shrink)
    sweep = {
        "theta_i_deg": sorted(
            random.choice([0.0, 20, 30, 45, 60, 70], random.integers(1, 3), False)
        ),
        "dphi_deg": [float(random.choice([0.0, 0, 0, 45, 90]))],
        "theta_r_deg": _view_angles(random),
    }
    frames = int(random.choice([n for n in (1, 2, 3, 4, 8, 16) if n >= least_frames]))
    side_mm = float(random.choice([10.0, 20, 30]))
    return changed(
        base,
        rig=_rig(base.rig, random, seed),
        sweeps=[sweep],
        window=PatchConfig(width_mm=side_mm, height_mm=side_mm),
        frames_per_point=frames,
        dark_frames=int(random.choice([4, 8, 16])),
        exposure_target=float(random.choice([0.4, 0.7, 0.8])),
        references=_references(random, again_at_end=seed % 2 == 0),
        simulated_sample=_sample(kind or str(random.choice(KINDS)), random),
    )


def _view_angles(random: np.random.Generator) -> list[float]:
    """Nine or so view angles, none of them in front of a lamp at one of the incidences."""
    offset = float(random.choice([-3.0, 2.0, 4.0]))
    edge = float(random.choice([60.0, 70.0, 76.0]))
    return [
        float(a) for a in np.round(np.linspace(-edge, edge, random.integers(7, 10)) + offset, 1)
    ]


def _rig(rig: Rig, random: np.random.Generator, seed: int) -> dict[str, object]:
    camera = rig.camera
    hot = [
        HotPixel(
            row=int(random.integers(camera.height_px)),
            column=int(random.integers(camera.width_px)),
            electrons_per_s=float(10 ** random.uniform(3, 5)),
        )
        for _ in range(int(random.choice([0, 0, 3, 10])))
    ]
    rounded = [float(s) for s in np.geomspace(camera.min_exposure_s, camera.max_exposure_s, 40)]
    defects = CameraDefects(
        hot_pixels=hot,
        exposures_s=rounded if random.random() < 0.2 else None,
        reads_back="taken",
    )
    simulation = rig.simulation.model_copy(
        update={
            "seed": seed,
            "sample_height_mm": float(rig.u_placement_mm * random.standard_normal()),
            "lamp_drift_per_hour": float(0.02 * random.standard_normal()),
            "camera_defects": defects,
        }
    )
    return {"simulation": simulation}


def _references(random: np.random.Generator, again_at_end: bool) -> References:
    tile = WhiteTile(
        reflectance=0.99,
        u_reflectance=0.005,
        theta_r_deg=10.0,
        frames=int(random.choice([4, 16])),
        width_mm=_TILE_MM,
        height_mm=_TILE_MM,
        again_at_end=again_at_end,
    )
    drift = DriftCheck(theta_r_deg=10.0, every_points=int(random.choice([3, 5, 8])))
    return References(white_tile=tile, drift_check=drift)


def _sample(kind: str, random: np.random.Generator) -> SimulatedSample:
    albedo = float(random.uniform(0.3, 0.95))
    model, parameters = {
        "matt": ("oren_nayar", {"albedo": albedo, "sigma_deg": float(random.uniform(5, 40))}),
        "gloss": (
            "oren_nayar+torrance_sparrow",
            {"albedo": albedo, "sigma_deg": float(random.uniform(8, 25)), "ks": 0.076},
        ),
        "dark": ("lambert", {"albedo": float(random.uniform(0.02, 0.06))}),
        "ggx": ("lambert+ggx", {"albedo": albedo, "f0": 0.04, "alpha": 0.3}),
    }[kind]
    mottling = float(random.choice([0.0, 0.02, 0.05]))
    return SimulatedSample(model=model, parameters=parameters, mottling=mottling)


def without_references(loaded: Loaded, tile: bool, drift: bool) -> Loaded:
    """Copy of a scan that keeps its white tile, or its drift checks, or neither."""
    own = loaded.protocol.references
    kept = References(
        white_tile=own.white_tile if tile else None, drift_check=own.drift_check if drift else None
    )
    return changed(loaded, references=kept)


def warming_lamp(share: float, loaded: Loaded) -> Faults:
    """Lamp that is darker by `share` at the beginning, and by 1/e of that after a third of a scan.

    Its output changes with each reading, to the level at the planned beginning of the next step.
    """
    plan, faults = make_plan(loaded), Faults()
    for n, step in enumerate(plan.steps):
        level = 1.0 - share * float(np.exp(-3.0 * step.start_s / plan.duration_s))
        if n == 0:
            faults.plan_world("lamp", f"{level:.6f}", "at", "camera.grab", 1)
        else:
            faults.plan_world("lamp", f"{level:.6f}", "after", "record.add_reading", n)
    return faults
