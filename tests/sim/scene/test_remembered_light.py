"""A picture that the tests remember is the one that would have been rendered."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sim.clock import SimulatedClock
from sim.scene.render import electrons_per_s
from sim.scene.scene import Scene
from tests.support.remembered_light import RememberedLight
from tests.support.scans import changed, simulated_scene, small_scan


def scene(seed: int = 1, shrink: int = 20) -> Scene:
    loaded = small_scan(shrink=shrink)
    simulation = loaded.rig.simulation.model_copy(update={"seed": seed})
    return simulated_scene(changed(loaded, rig={"simulation": simulation}), 30.0, 40.0)


def changes(random: np.random.Generator) -> list[Callable[[Scene], object]]:
    """Changes of a scene, each of which its picture shows."""
    angle, shift = random.uniform(5.0, 60.0), random.uniform(1.0, 9.0)

    def set_axes(of: Scene) -> None:
        for axis in ("theta_i", "dphi", "theta_r"):
            of.set_axis(axis, angle)

    def change_sample(of: Scene) -> None:
        parameters = {**of.sample.parameters, "albedo": random.uniform(0.2, 0.5)}
        of.sample = of.sample.model_copy(update={"parameters": parameters})

    def mount(of: Scene) -> None:
        of.surface = "white tile"

    def strike(of: Scene) -> None:
        of.world = replace(of.world, shift_mm=shift)

    def lift(of: Scene) -> None:
        of.heights_mm["sample"] += shift

    return [set_axes, change_sample, mount, strike, lift]


def unseen(of: Scene, random: np.random.Generator) -> None:
    """Change all that belongs to a frame: its noise, its exposure and the age of the lamp."""
    of.lit = not of.lit
    of.rings.clear()
    of.motions["theta_r"] = lambda time_s: time_s
    clock = SimulatedClock()
    clock.sleep(random.uniform(1.0, 9e3))
    of.clock = clock
    of.begin_step(int(random.integers(1, 99)), 0.0)


@pytest.mark.parametrize("seed", range(3))
def test_a_changed_scene_is_rendered_anew_and_an_equal_one_is_not(seed: int) -> None:
    random, rendered = np.random.default_rng(seed), list[Scene]()

    def render(of: Scene) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
        rendered.append(of)
        return electrons_per_s(of)

    light = RememberedLight(render)
    light(scene(seed))
    assert not np.array_equal(light(scene(seed + 1)), light(scene(seed)))
    for number, change in enumerate(changes(random)):
        one, other = scene(seed), scene(seed)
        change(one)
        assert np.array_equal(light(one), electrons_per_s(one))
        assert not np.array_equal(light(one), light(other))
        unseen(one, random)
        assert np.array_equal(light(one), electrons_per_s(one))
        assert len(rendered) == 3 + number


def test_the_oldest_pictures_are_forgotten() -> None:
    rendered = list[str]()

    def render(of: Scene) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
        rendered.append(of.surface)
        return np.zeros((10, 10), np.float32)

    light = RememberedLight(render, most_bytes=800)
    for surface in ("sample", "white tile", "sample", "board", "sample", "white tile"):
        one = scene()
        one.surface = surface
        light(one)
    assert rendered == ["sample", "white tile", "board", "white tile"]
