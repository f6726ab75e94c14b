"""Outline: no alarm within the uncertainties; slips, moved surfaces and wrong sizes are told."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from acquisition.interlocks.picture.outline_check import OutlineCheck
from acquisition.plan.plan import Step
from acquisition.plan.pose import Pose
from instrument.config.load import Loaded, load_protocol
from instrument.config.protocol import References, WhiteTile
from instrument.devices import Image, Surface
from instrument.errors import Interlock
from instrument.geometry import FloatArray
from instrument.pinhole import Pinhole
from instrument.record.record import Record
from sim.scene.scene import Scene
from sim.scene.sensor import Sensor
from tests.support.paths import CONFIGS
from tests.support.random_pictures import Picture, random_picture, step_at
from tests.support.scans import changed, small_scan
from tests.support.whole_scans.stopped_scan import scan

RIGS = {"bench_12bit": 0.005, "paper_1995": 0.01, "emulated": 0.0002}  # with an exposure in s


def _step(surface: Surface, theta_r_deg: float, index: int = 0) -> Step:
    return step_at(surface, Pose(45.0, 0.0, theta_r_deg), index)


@cache
def _demo(rig: str) -> Loaded:
    return load_protocol(CONFIGS / "protocols" / "demo.yaml", CONFIGS / "rigs" / f"{rig}.yaml")


def _scene(loaded: Loaded, theta_r_deg: float) -> Scene:
    scene = Scene.of(loaded.rig, loaded.protocol)
    for axis, angle in (("theta_i", 45.0), ("dphi", 0.0), ("theta_r", theta_r_deg)):
        scene.set_axis(axis, angle)
    return scene


def _told(rig: str, said_deg: float, true_deg: float) -> str:
    """What is said of a picture at one angle where the stage reports another."""
    (text,) = _told_each(rig, said_deg, [true_deg])
    return text


def _told_each(
    rig: str, said_deg: float, true_deg: Sequence[float], before_deg: Sequence[float] = ()
) -> list[str]:
    """What is said of a picture at each true angle where the stage reports another.

    `before_deg`: angles of sound pictures before each of them.
    """
    loaded = _demo(rig)
    scene = _scene(loaded, 0.0)
    sensor, check = Sensor(scene), OutlineCheck.of(loaded.rig, loaded.protocol)
    for angle in before_deg:
        scene.set_axis("theta_r", angle)
        assert check.contradiction(sensor.picture(RIGS[rig]), _step("sample", angle)) == ""
    told = []
    for angle in true_deg:
        scene.set_axis("theta_r", angle)
        own = deepcopy(check)
        told.append(own.contradiction(sensor.picture(RIGS[rig]), _step("sample", said_deg)))
    return told


@pytest.mark.slow
def test_random_pictures_without_a_fault_raise_no_alarm(slow: bool) -> None:
    """Rigs, samples, textures, exposures, sweeps; true values off by what u says of them."""
    told = []
    for seed in range(500 if slow else 12):
        picture = random_picture(seed)
        check, angles = picture.check, np.random.default_rng(seed).uniform(-82, 82, 5)
        for angle in (picture.theta_r_deg, *angles.tolist()):
            image = picture.at(angle).take()
            told.append(check.contradiction(image, _step("sample", angle)))
    assert not [text for text in told if text]


def test_most_pictures_of_a_bright_sample_show_their_edges() -> None:
    """Otherwise silence would be no proof."""
    compared = [p.check.compare(p.take(), "sample", p.theta_r_deg)
                for p in map(_bright, range(60)) if abs(p.theta_r_deg) < 70]  # fmt: skip
    inside = [c for c in compared if _is_inside(c.outline.corners_px(), c.outline.pinhole)]
    assert len(inside) > 15
    assert [len(c.edges) for c in inside] == [4] * len(inside)


def _is_inside(corners: FloatArray, pinhole: Pinhole) -> bool:
    size = np.array([pinhole.width_px, pinhole.height_px])
    across = np.linalg.norm(corners[0] - corners[[1, 3]], axis=1)
    return bool(np.all((corners > 25) & (corners < size - 25)) and np.all(across > 50))


def _bright(seed: int) -> Picture:
    """A random picture whose sample is brighter than the table, and exposed well."""
    picture = random_picture(seed)
    rig = picture.scene.rig
    simulation = rig.simulation.model_copy(update={"background_reflectance": 0.02})
    picture.scene.rig = rig.model_copy(update={"simulation": simulation})
    picture.scene.sample = picture.scene.sample.model_copy(
        update={"model": "lambert", "parameters": {"albedo": 0.8}, "mottling": 0.02}
    )
    picture.scene.true_deg["theta_i"] = 30.0
    full = rig.camera.full_well_electrons
    return replace(picture, exposure_s=0.7 * full / rig.lamp.white_electrons_per_s)


@pytest.mark.parametrize("said_deg", [-80.0, -60.0, 55.0, 75.0])
def test_a_slip_of_5_degrees_is_seen_in_the_first_picture(said_deg: float) -> None:
    for slip_deg in (-5.0, 5.0):
        text = _told("bench_12bit", said_deg, said_deg + slip_deg)
        assert f"is not where theta_r {said_deg:g} deg puts it in the picture" in text
        seen = float(text.split("that of theta_r ")[1].split()[0])
        assert seen == pytest.approx(said_deg + slip_deg, abs=0.4)


@pytest.mark.parametrize("said_deg", [-75.0, -60.0, 60.0, 75.0])
@pytest.mark.parametrize("rig", ["paper_1995", "emulated"])
def test_so_it_is_at_oblique_angles_on_the_other_rigs(rig: str, said_deg: float) -> None:
    assert "The picture is that of theta_r" in _told(rig, said_deg, said_deg - 5.0)
    assert "The picture is that of theta_r" in _told(rig, said_deg, said_deg + 5.0)


@pytest.mark.parametrize("said_deg", [-35.0, 25.0])
@pytest.mark.parametrize("rig", RIGS)
def test_a_smaller_slip_is_seen_in_a_later_picture(rig: str, said_deg: float) -> None:
    """Once earlier pictures have told size and place of the surface: 2 degrees, nearly anywhere."""
    before_deg = np.arange(-70.0, said_deg, 15.0).tolist()
    slipped_deg = [said_deg - 2.0, said_deg + 2.0]
    for true_deg, text in zip(
        slipped_deg, _told_each(rig, said_deg, slipped_deg, before_deg), strict=True
    ):
        seen = float(text.split("that of theta_r ")[1].split()[0])
        assert seen == pytest.approx(true_deg, abs=0.5)


@pytest.mark.parametrize("rig", RIGS)
@pytest.mark.parametrize("angle_deg", [-75.0, 0.0, 60.0])
def test_no_slip_no_word(rig: str, angle_deg: float) -> None:
    assert _told(rig, angle_deg, angle_deg) == ""


def test_a_shifted_sample_is_told_as_such() -> None:
    loaded = _demo("bench_12bit")
    scene = _scene(loaded, 20.0)
    moved = loaded.rig.camera.model_copy(update={"axis_column_px": 317.0 + 90})
    scene.rig = loaded.rig.model_copy(update={"camera": moved})
    check = OutlineCheck.of(loaded.rig, loaded.protocol)
    text = check.contradiction(Sensor(scene).picture(0.005), _step("sample", 20.0))
    assert "off its place" in text
    assert float(text.split("A surface ")[1].split()[0]) == pytest.approx(10.8, abs=0.5)


def _with_tile(loaded: Loaded, width_mm: float, height_mm: float) -> Loaded:
    tile = WhiteTile(reflectance=0.99, u_reflectance=0.005, theta_r_deg=10.0, frames=4,
                     width_mm=width_mm, height_mm=height_mm)  # fmt: skip
    drift = loaded.protocol.references.drift_check
    return changed(loaded, references=References(white_tile=tile, drift_check=drift))


def test_a_tile_left_on_the_table_is_told_by_its_size() -> None:
    loaded = _with_tile(_demo("bench_12bit"), 40.0, 45.0)
    scene = _scene(loaded, 35.0)
    scene.surface = "white tile"
    check = OutlineCheck.of(loaded.rig, loaded.protocol)
    picture = Sensor(scene).picture(0.002)
    assert check.contradiction(picture, _step("white tile", 35.0)) == ""
    text = check.contradiction(picture, _step("sample", 35.0))
    assert "The white tile (40 x 45 mm) would look like this: is it still on the table?" in text


def test_a_wrong_size_is_told_with_the_size_that_is_seen() -> None:
    loaded = _demo("bench_12bit")
    scene = _scene(loaded, -10.0)
    scene.sample_size = scene.sample_size.model_copy(update={"height_mm": 35.0})
    check = OutlineCheck.of(loaded.rig, loaded.protocol)
    text = check.contradiction(Sensor(scene).picture(0.005), _step("sample", -10.0))
    seen_mm = [float(word) for word in text.split("A surface of ")[1].split()[:3:2]]
    assert seen_mm == pytest.approx([50.8, 35.0], abs=0.2)
    assert "would look like this: look what lies on the table" in text


def test_a_round_sample_is_told_how_to_go_on_and_can_be_left_out() -> None:
    loaded = _demo("bench_12bit")
    rows, columns = np.mgrid[:512, :640]
    disc = np.hypot(rows - 257.5, columns - 317) < 225
    picture: Image = (70 + 2000 * disc).astype(np.uint16)
    check = OutlineCheck.of(loaded.rig, loaded.protocol)
    sample = loaded.protocol.sample.model_copy(update={"outline": "none"})
    unchecked = OutlineCheck.of(loaded.rig, changed(loaded, sample=sample).protocol)
    assert unchecked.contradiction(picture, _step("sample", 0.0)) == ""
    text = check.contradiction(picture, _step("sample", 0.0))
    assert text == "" or "outline: none" in text


def test_a_slip_in_mid_scan_ends_it_and_names_the_step(
    record: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From the 17th setting of the view angle on, the stage is 5 degrees further than it says."""
    true, count = Scene.set_axis, [0]

    def slipped(scene: Scene, axis: str, angle_deg: float) -> None:
        count[0] += axis == "theta_r"
        true(scene, axis, angle_deg + 5.0 * (axis == "theta_r" and count[0] > 16))

    monkeypatch.setattr(Scene, "set_axis", slipped)
    with pytest.raises(Interlock, match=r"theta_r [-\d.]+ deg puts it .* two frames of step \d+"):
        scan(small_scan(shrink=3), record)
    assert record.readings()


def test_one_picture_with_a_hand_in_it_is_noted_and_the_next_counts(
    record: Record, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    answers = iter(["", "", "a hand", "", *[""] * 100])
    monkeypatch.setattr(OutlineCheck, "contradiction", lambda *_: next(answers))
    scan(small_scan(), record)
    told = [r.getMessage() for r in caplog.records if r.name == "acquisition.interlocks"]
    assert told == ["a hand. A second frame shows it at its place, and counts"]


@pytest.mark.parametrize(("slip_deg", "doubted"), [(5.0, [3, 4, 5]), (1.5, [0, 1, 2, 3, 4, 5, 6])])
def test_pictures_that_would_not_have_shown_the_slip_are_in_doubt(
    slip_deg: float, doubted: list[int]
) -> None:
    loaded = _demo("bench_12bit")
    scene = _scene(loaded, 0.0)
    sensor, check = Sensor(scene), OutlineCheck.of(loaded.rig, loaded.protocol)
    angles = (-70.0, -50.0, -30.0, -8.0, -2.0, 2.0, 8.0)
    for index, angle in enumerate(angles[: doubted[-1] + 1]):
        scene.set_axis("theta_r", angle)
        picture = sensor.picture(RIGS["bench_12bit"])
        assert check.contradiction(picture, _step("sample", angle, index)) == ""
    scene.set_axis("theta_r", 40.0 + slip_deg)
    picture = sensor.picture(RIGS["bench_12bit"])
    assert check.contradiction(picture, _step("sample", 40.0, 9))
    assert sorted(check.doubted) == doubted
