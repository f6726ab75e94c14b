"""Watched camera: changed settings, frames out of order and pictures that stay end a scan."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from acquisition.engine.engine import Devices, Engine
from acquisition.engine.resume import Progress
from acquisition.interlocks.watched_camera import WatchedCamera
from acquisition.measure.drift import rate
from acquisition.plan.plan import make_plan
from acquisition.rig import OpenRig
from instrument.config.load import Loaded
from instrument.devices import Frame
from instrument.errors import CameraLost, Interlock
from instrument.record.reading import Reading
from instrument.record.record import Record
from sim.defects.world import World
from sim.scene.scene import Scene
from tests.support.scans import undated
from tests.support.stand_ins import PassThrough
from tests.support.synthetic_frames import RIGS, noisy_frames

CAMERA = RIGS[12].camera


class Numbered:
    """Camera that returns numbered frames of noise, and settings that a test changes."""

    def __init__(self) -> None:
        self.random = np.random.default_rng(5)
        self.numbers: list[int | None] = []
        self.now = {"gain": "100", "exposure": "0.01 s", "brightness": "0"}
        self.lost = False

    def grab(self, count: int) -> list[Frame]:
        if self.lost:
            self.lost = False
            raise CameraLost("camera: gone")
        numbers, self.numbers = self.numbers[:count], self.numbers[count:]
        frames = noisy_frames(self.random, CAMERA, [0.5] * count, (24, 32))
        return [replace(f, sequence=n) for f, n in zip(frames, numbers, strict=True)]

    def settings(self) -> dict[str, str]:
        return dict(self.now)


def watched(*numbers: int | None) -> tuple[WatchedCamera, Numbered]:
    camera = Numbered()
    camera.numbers = list(numbers)
    watch = WatchedCamera(camera, CAMERA)  # type: ignore[arg-type]  # a stand-in
    watch.expect({})
    return watch, camera


@pytest.mark.parametrize(
    "numbers",
    [(0, 1, 2, 3), (7, 8, 20, 21), (2**32 - 2, 2**32 - 1, 0, 1), (None,) * 4, (None, None, 0, 1)],
)
def test_numbers_that_rise_pass_with_gaps_and_when_they_wrap(numbers: tuple[int | None]) -> None:
    watch, _ = watched(*numbers)
    assert [f.sequence for _ in range(2) for f in watch.grab(2)] == list(numbers)


@pytest.mark.parametrize(("numbers", "text"), [
    ((4, 4, 5, 6), "frame 2 of 2 has the camera's sequence number 4 after 4"),
    ((4, 5, 5, 6), "frame 1 of 2 has the camera's sequence number 5 after 5"),
    ((4, 5, 3, 6), "frame 1 of 2 has the camera's sequence number 3 after 5"),
])  # fmt: skip
def test_a_number_that_does_not_rise_is_an_old_frame(numbers: tuple[int], text: str) -> None:
    watch, _ = watched(*numbers)
    with pytest.raises(Interlock, match=f"^frame order: {text}"):
        [watch.grab(2) for _ in range(2)]


def test_a_camera_that_was_lost_counts_from_zero_again() -> None:
    watch, camera = watched(400, 401, 0, 1)
    watch.grab(2)
    camera.lost = True
    with pytest.raises(CameraLost):
        watch.grab(2)
    watch.grab(2)


def test_a_setting_that_changed_is_named_with_both_values() -> None:
    watch, camera = watched(*range(8))
    watch.grab(2)
    camera.now["exposure"] = "0.02 s"  # the scan sets it
    watch.grab(2)
    camera.now["brightness"] = "12"
    expected = r"^camera settings: brightness reads 12, but 0 when the scan began: another program"
    with pytest.raises(Interlock, match=expected):
        watch.grab(2)


def run(
    loaded: Loaded, record: Record, spoil: Callable[[Scene, int, list[Frame]], list[Frame]]
) -> list[Reading]:
    """Scan or resume on a simulated rig; `spoil(scene, series, frames)` acts after each series."""
    scene = Scene.of(loaded.rig, loaded.protocol)
    devices = with_scene(loaded, scene)

    class Spoiling(PassThrough):
        series = 0

        def grab(self, count: int) -> list[Frame]:
            self.series += 1
            return spoil(scene, self.series, devices.camera.grab(count))

    spoilt = replace(devices, camera=Spoiling(devices.camera))  # type: ignore[arg-type]  # as above
    progress = Progress.of(record) if record.readings() else None
    Engine(loaded.protocol, loaded.rig, spoilt, record, lambda _: None).run(
        make_plan(loaded), progress
    )
    return undated(record.readings())


def with_scene(loaded: Loaded, scene: Scene) -> Devices:
    rig = OpenRig(loaded.rig, scene)
    axes = {name: rig.axis(name) for name in ("theta_i", "dphi", "theta_r")}
    return Devices(axes, rig.camera(), rig.lamp, rig.operator, rig.clock, rig.begin_step)


def another_program(scene: Scene, series: int, frames: list[Frame]) -> list[Frame]:
    """Set the gain from 100 to 150 in mid-scan."""
    scene.world = World(gain=1.5 if series >= 14 else 1.0)
    return frames


def test_a_gain_that_another_program_changes_ends_the_scan_and_resume_restores_it(
    small: Loaded, whole: list[Reading], record: Record
) -> None:
    with pytest.raises(Interlock, match="gain reads 150, but 100 when the scan began"):
        run(small, record, another_program)
    accepted = undated(record.readings())
    assert accepted
    assert accepted == whole[: len(accepted)]  # no reading was taken at the other gain
    with pytest.raises(Interlock, match="gain reads 150, but 100 when the scan began"):
        Engine(small.protocol, small.rig, still_changed(small), record, lambda _: None).run(
            make_plan(small), Progress.of(record)
        )
    again = run(small, record, lambda *a: a[2])  # with what followed the last drift check
    assert [r.step for r in again] == [r.step for r in whole]
    assert [rate(r) for r in again] == pytest.approx([rate(r) for r in whole], rel=1e-3)


def still_changed(loaded: Loaded) -> Devices:
    """Devices of which the camera still has the other gain."""
    scene = Scene.of(loaded.rig, loaded.protocol)
    scene.world = World(gain=1.5)
    return with_scene(loaded, scene)


@pytest.mark.parametrize("begins", [3, 9, 15])
def test_the_same_picture_for_ever_ends_the_scan(
    small: Loaded, record: Record, begins: int
) -> None:
    last: list[Frame] = []

    def freeze(_: Scene, series: int, frames: list[Frame]) -> list[Frame]:
        last[:] = frames if series < begins else last
        return [replace(f, image=last[-1].image) for f in frames]

    with pytest.raises(Interlock, match=r"^frozen picture: "):
        run(small, record, freeze)


def test_a_frame_that_is_half_black_is_flagged_and_recorded(
    small: Loaded, record: Record, whole: list[Reading]
) -> None:
    spoilt: list[int] = []

    def blacken(scene: Scene, series: int, frames: list[Frame]) -> list[Frame]:
        if not spoilt and series >= 14 and scene.lit and len(frames) > 1:
            spoilt.append(series)
            half = frames[1].image.copy()
            half[: half.shape[0] // 2] = 64
            frames[1] = replace(frames[1], image=half)
        return frames

    found = run(small, record, blacken)
    changed = [r for r, sound in zip(found, whole, strict=True) if r != sound]
    assert {r.flags for r in changed} == {"frames differ"}
    (text,) = [text for _, kind, text in record.events() if kind == "interlock"]
    assert text.startswith(f"step {changed[0].step}: frames differ: ")


def test_an_exposure_that_another_program_sets_ends_the_scan(small: Loaded, record: Record) -> None:
    def another(scene: Scene, series: int, frames: list[Frame]) -> list[Frame]:
        scene.world = World(control=2.0 if series >= 14 else 1.0)
        return frames

    with pytest.raises(
        Interlock, match=r"^camera settings: exposure .* s, but .* s was set: anoth"
    ):
        run(small, record, another)
