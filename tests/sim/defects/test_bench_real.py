"""Rig file of a real bench: each of its defects shows, and a scan on it goes to its end."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.results.reduction import reduced_run
from instrument.config.load import Loaded, load_protocol
from instrument.config.rig import Simulation
from instrument.config.section import Section
from instrument.config.simulated.sample import SimulatedSample
from instrument.config.simulated.spread import Spread
from instrument.devices import Image
from instrument.record.reading import Reading
from instrument.record.record import Record
from sim.clock import SimulatedClock
from sim.scene.camera import SimulatedCamera
from tests.support.paths import CONFIGS
from tests.support.scans import changed, simulated_scene, small_scan, undated
from tests.support.whole_scans.stopped_scan import scan

SMALL = small_scan("bench_real")
GLOSSY = SimulatedSample(
    model="lambert+torrance_sparrow", parameters={"albedo": 0.5, "ks": 0.1, "sigma_deg": 20.0}
)
POSE = {"theta_i": 60.0, "dphi": 30.0, "theta_r": 40.0}


def paths(section: Section, before: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Keys of each size that is not 0."""
    for name, field in type(section).model_fields.items():
        value = getattr(section, name)
        if isinstance(value, Section):
            yield from paths(value, (*before, name))
        elif value and any(isinstance(mark, Spread) for mark in field.metadata):
            yield *before, name


def without(path: tuple[str, ...]) -> Simulation:
    """The file's simulation with one size at 0, or a time constant at twice its own."""
    simulation = SMALL.rig.simulation.model_dump()
    section: dict[str, Any] = functools.reduce(lambda part, key: part[key], path[:-1], simulation)
    section[path[-1]] = 2 * section[path[-1]] if path[-1].endswith("_s") else 0.0
    return Simulation.model_validate(simulation)


def pictures(simulation: Simulation, before: tuple[str, ...] = ()) -> list[Image]:
    """Frames of the sample, of the tile and in the dark, an hour after `before` was looked at."""
    loaded = changed(SMALL, rig={"simulation": simulation}, simulated_sample=GLOSSY)
    scene, clock = simulated_scene(loaded), SimulatedClock()
    scene.use_clock(clock)
    camera = SimulatedCamera(scene, clock)
    camera.set_exposure_s(0.02)
    for surface in before:
        scene.surface = "white tile" if surface == "white tile" else "sample"
        camera.grab(2)
    found = []
    for axis, angle_deg in POSE.items():
        scene.set_axis(axis, angle_deg)
    for step, (surface, lit, exposure_s) in enumerate(
        (("sample", True, 0.02), ("white tile", True, 0.02), ("sample", False, 1.0))
    ):
        scene.surface = "white tile" if surface == "white tile" else "sample"
        scene.lit = lit
        scene.begin_step(step + 1, 600.0 + 60.0 * step)
        camera.set_exposure_s(exposure_s)
        found += [frame.image for frame in camera.grab(2)]
    return found


def same(one: list[Image], other: list[Image]) -> bool:
    return all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))


def test_each_defect_of_the_file_shows() -> None:
    """So small a picture has no dead pixel."""
    real = pictures(SMALL.rig.simulation)
    sizes = [path for path in paths(SMALL.rig.simulation) if path[-1] != "dead_share"]
    assert len(sizes) > 35
    for path in sizes:
        assert not same(pictures(without(path)), real), path


def test_a_picture_does_not_depend_on_those_before_it() -> None:
    simulation = SMALL.rig.simulation
    assert same(pictures(simulation), pictures(simulation, ("white tile", "sample")))


def test_a_scan_of_a_drawn_bench_may_be_resumed(tmp_path: Path) -> None:
    """The same counts to the byte as in one go, and no interlock stops it.

    But for two things: a resume takes its darks anew, with a camera that is warmer by then (here it
    is not), and judges the scatter of frames without the readings before it.
    """
    cold = {**SMALL.rig.simulation.camera_defects.model_dump(), "warming_k": 0.0}
    drawn = {"drawn": True, "seed": 7, "camera_defects": cold}
    own = Simulation.model_validate({**SMALL.rig.simulation.model_dump(), **drawn})
    loaded = changed(SMALL, rig={"simulation": own}, simulated_sample=GLOSSY)
    with Record.create(tmp_path / "whole", {}) as record:
        scan(loaded, record)
        whole = record.readings()
        reduced = reduced_run(record, loaded)
    with Record.create(tmp_path / "parts", {}) as record:
        scan(loaded, record, upto=6)
        scan(loaded, record)
        parts = record.readings()
    assert without_scatter(parts) == without_scatter(whole)
    assert not any(reduced.flags)


def without_scatter(readings: list[Reading]) -> list[Reading]:
    return [replace(r, u_noise_dn=0.0) for r in undated(readings)]


@pytest.mark.slow
def test_no_interlock_stops_a_scan_of_a_bench_drawn_anew(tmp_path: Path, slow: bool) -> None:
    demo = load_protocol(CONFIGS / "protocols" / "demo.yaml", CONFIGS / "rigs" / "bench_real.yaml")
    for seed in range(8 if slow else 0):
        drawn = demo.rig.simulation.model_copy(update={"drawn": True, "seed": seed})
        loaded: Loaded = changed(demo, rig={"simulation": drawn})
        with Record.create(tmp_path / str(seed), {}) as record:
            scan(loaded, record)
            assert not any(reduced_run(record, loaded).flags), seed
