"""Swap: a tile left on the table is told on every rig, another white piece is not taken for it."""

from __future__ import annotations

import pytest

from acquisition.interlocks.picture.swap import SwapCheck
from acquisition.plan.pose import Pose
from instrument.config.load import load_protocol
from instrument.config.simulated.sample import SimulatedSample
from instrument.devices import Frame
from instrument.errors import Interlock
from instrument.record.record import Record
from sim.defects.world import World
from sim.scene.scene import Scene
from sim.scene.sensor import Sensor
from tests.support.paths import CONFIGS
from tests.support.random_pictures import step_at
from tests.support.scans import changed, small_scan
from tests.support.whole_scans.stopped_scan import scan

POSE = Pose(45.0, 0.0, 10.0)
RIGS = {"bench_12bit": 0.002, "paper_1995": 0.008, "emulated": 0.0001}  # with an exposure in s
WHITE = SimulatedSample(model="lambert", parameters={"albedo": 0.99})


def _after_the_tile(
    rig: str, sample: SimulatedSample | None = None, world: World | None = None, level: float = 1.0
) -> str:
    """What is said of the sample's first picture; `world`: where it lies; `level`: the lamp's."""
    loaded = load_protocol(CONFIGS / "protocols/demo.yaml", CONFIGS / "rigs" / f"{rig}.yaml")
    if sample is not None:
        loaded = changed(loaded, simulated_sample=sample)
    scene = Scene.of(loaded.rig, loaded.protocol)
    for name, angle in POSE._asdict().items():
        scene.set_axis(name, angle)
    sensor, check = Sensor(scene), SwapCheck(loaded.rig.camera)
    scene.surface = "white tile"
    taken_s = RIGS[rig]
    told = [
        check.contradiction(
            Frame(sensor.picture(taken_s), taken_s, 0.0), step_at("white tile", POSE)
        )
    ]
    if world is None:
        scene.surface = "sample"
    scene.world, scene.step = world or World(lamp=level), 1
    image = sensor.picture(taken_s / 2)
    told.append(check.contradiction(Frame(image, taken_s / 2, 0.0), step_at("sample", POSE)))
    assert told[0] == ""
    return told[1]


@pytest.mark.parametrize("rig", RIGS)
@pytest.mark.parametrize("level", [1.0, 0.997])
def test_a_tile_left_on_the_table_is_told(rig: str, level: float) -> None:
    text = _after_the_tile(rig, world=World(mounted="white tile", lamp=level))
    assert "the picture of the sample is that of the white tile before it" in text


@pytest.mark.parametrize("rig", RIGS)
def test_a_sample_of_another_material_is_not(rig: str) -> None:
    assert _after_the_tile(rig) == ""


@pytest.mark.parametrize("rig", RIGS)
@pytest.mark.parametrize("shift_mm", [0.1, -0.3])
def test_a_piece_of_the_tile_laid_down_anew_is_not(rig: str, shift_mm: float) -> None:
    assert _after_the_tile(rig, world=World(shift_mm=shift_mm)) == ""


def test_a_scan_in_which_the_tile_was_never_taken_away_ends(
    record: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Scene, "mounted", "white tile")
    with pytest.raises(Interlock, match=r"interlock swap: .* still on the table"):
        scan(small_scan(), record)
    assert {reading.kind for reading in record.readings()} == {"tile"}
