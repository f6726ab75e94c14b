"""Each fault of the world changes the pictures, and nothing else does."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from instrument.devices import Image
from sim.clock import SimulatedClock
from sim.defects.world import SOUND, World
from sim.scene.camera import SimulatedCamera
from tests.support.scans import simulated_scene, small_scan

SIZES = {
    "lamp": "0.9", "lens": "0.9", "flicker": "0.1", "shutter_open": "0.9", "shutter_shut": "0.1",
    "room": "0.1", "spot": "1", "glare": "0.1", "shadow": "0.5", "blur_mm": "1", "theta_i_deg": "5",
    "dphi_deg": "20", "theta_r_deg": "5", "shift_mm": "3", "turn_deg": "5", "tilt_deg": "3",
    "mounted": "white tile", "exposure": "1.1", "control": "1.1", "gain": "1.1", "amplifier": "1.1",
    "black_dn": "5",
    "gamma": "0.9", "noise": "0.5", "hot_px": "4", "dead_columns": "2", "stuck_bit": "3",
    "black_rows": "0.1", "repeats": "1", "stale": "1", "frozen": "1",
}  # fmt: skip


def pictures(world: World) -> list[Image]:
    """Two frames of a sound world, then series of three in the light and the dark."""
    scene = simulated_scene(small_scan())
    camera = SimulatedCamera(scene, SimulatedClock())
    camera.set_exposure_s(0.02)
    camera.grab(2)
    scene.world = world
    scene.begin_step(1, 0.0)
    lit = camera.grab(3)
    scene.lit = False
    return [frame.image for frame in lit + camera.grab(3)]


def same(one: list[Image], other: list[Image]) -> bool:
    return all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))


def test_every_fault_has_a_size_here() -> None:
    assert set(SIZES) == {field.name for field in fields(World)}


@pytest.mark.parametrize(("fault", "size"), SIZES.items())
def test_each_fault_shows_and_ends(fault: str, size: str) -> None:
    sound, faulty = pictures(SOUND), SOUND.changed(fault, size)
    assert not same(pictures(faulty), sound)
    assert same(pictures(faulty.changed(fault, str(getattr(SOUND, fault)))), sound)


def test_a_fault_leaves_the_noise_as_it_was() -> None:
    """Half the light, by half the noise's square: the same pixels are bright and dark."""
    sound, dim = (pictures(w)[2].astype(float) for w in (SOUND, SOUND.changed("lamp", "0.999")))
    difference = (sound - dim)[40:60, 50:70]
    assert difference.std() < 0.3 * sound[40:60, 50:70].std()


@pytest.mark.parametrize(
    ("fault", "value", "allowed"),
    [("lamps", "0", "allowed: lamp, lens"), ("mounted", "cat", "allowed: as asked, sample, white"),
     ("lamp", "dim", "could not convert")],
)  # fmt: skip
def test_an_unknown_fault_is_refused(fault: str, value: str, allowed: str) -> None:
    with pytest.raises(ValueError, match=allowed):
        SOUND.changed(fault, value)
