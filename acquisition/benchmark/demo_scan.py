"""Simulated scans: the shipped demonstration with other settings and a binned camera.

`configs/protocols/demo.yaml` and its rig are read as package data. Binning the camera's pixels
lets a hundred scans take a minute.
"""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace
from functools import cache
from importlib.resources import files
from pathlib import Path

from acquisition.engine.engine import Engine
from acquisition.plan.plan import make_plan
from acquisition.results.reduction import Reduced, reduced_run
from acquisition.rig import open_devices
from instrument.config.load import Loaded, load_protocol, load_rig
from instrument.config.protocol import Protocol, Steps
from instrument.config.rig import Rig
from instrument.config.simulated.sample import SimulatedSample
from instrument.record.record import Record

BINNING = 2
"""Pixels a side that are binned: 4 of them hold 4 times the electrons.

Not more: with 4 a side the sample's mottling, cut by coarse pixels at the edge of the patch, would
add as much error to the roughness as everything else does."""

_CONFIGS = Path(str(files("configs")))


@cache
def shipped_demo() -> Loaded:
    """Return the demonstration's protocol and rig as shipped."""
    return load_protocol(_CONFIGS / "protocols" / "demo.yaml")


@cache
def shipped_rig(name: str) -> Rig:
    """Return a shipped rig by its name."""
    return load_rig(_CONFIGS / "rigs" / f"{name}.yaml")


def view_step_deg(views: int) -> float:
    """Return the step in degrees between so many view angles of the demonstration's sweep."""
    steps = _view_steps(shipped_demo().protocol)
    return (steps.stop - steps.start) / (views - 1)


def demonstration(
    *,
    views: int | None = None,
    frames: int | None = None,
    exposure_target: float | None = None,
    seed: int | None = None,
) -> Loaded:
    """Return the demonstration with its camera binned, and with other settings where given.

    views: number of view angles at each incidence. frames: number per point. exposure_target:
    fraction of full scale. The least number of pixels in the window is scaled with the binning.
    """
    shipped = shipped_demo()
    protocol, rig = shipped.protocol, binned(shipped.rig)
    steps = _view_steps(protocol)
    steps = steps.model_copy(update={"num": views or steps.count, "step": None})
    window = protocol.window
    least = window.min_pixels // BINNING**2
    protocol = protocol.model_copy(
        update={
            "sweeps": [{**protocol.sweeps[0], "theta_r_deg": steps}],
            "frames_per_point": frames or protocol.frames_per_point,
            "exposure_target": exposure_target or protocol.exposure_target,
            "window": window.model_copy(update={"min_pixels": least}),
        }
    )
    if seed is not None:
        simulation = rig.simulation.model_copy(update={"seed": seed})
        rig = rig.model_copy(update={"simulation": simulation})
    return replace(shipped, protocol=protocol, rig=rig)


def binned(rig: Rig) -> Rig:
    """Return the rig with BINNING x BINNING pixels binned: the same number of electrons in all."""
    camera, area = rig.camera, BINNING**2
    binned_camera = {
        "width_px": camera.width_px // BINNING,
        "height_px": camera.height_px // BINNING,
        "axis_row_px": (camera.axis_row_px + 0.5) / BINNING - 0.5,
        "axis_column_px": (camera.axis_column_px + 0.5) / BINNING - 0.5,
        "full_well_electrons": camera.full_well_electrons * area,
        "dark_current_electrons_per_s": camera.dark_current_electrons_per_s * area,
        "read_noise_electrons": camera.read_noise_electrons * BINNING,
    }
    brighter = {"white_electrons_per_s": rig.lamp.white_electrons_per_s * area}
    return rig.model_copy(
        update={
            "camera": camera.model_copy(update=binned_camera),
            "lamp": rig.lamp.model_copy(update=brighter),
        }
    )


def _view_steps(protocol: Protocol) -> Steps:
    steps = protocol.sweeps[0]["theta_r_deg"]
    if not isinstance(steps, Steps):
        raise ValueError("demo.yaml: theta_r_deg is a list; allowed: start, stop and num")
    return steps


def reduced_scan(loaded: Loaded, folder: Path) -> Reduced:
    """Scan with the program's own engine into a new folder, and return the reduced points."""
    with closing(open_devices(loaded)) as devices, Record.create(folder, {}) as record:
        engine = Engine(loaded.protocol, loaded.rig, devices, record, lambda _: None)
        engine.run(make_plan(loaded))
        return reduced_run(record, loaded)


def sample_of(loaded: Loaded) -> SimulatedSample:
    """Return the simulated sample of a scan, which knows the truth."""
    sample = loaded.protocol.simulated_sample
    if sample is None:
        raise ValueError(f"{loaded.protocol_path}: simulated_sample is missing; required here")
    return sample
