"""Faults of a V4L2 camera within a scan: recovery or a named stop, never another value.

The driver runs in a child process over an emulated camera that looks at the simulated scene; stage,
lamp and operator are simulated. What the driver logs there is logged here, and so in the record.
"""

from __future__ import annotations

import copy
import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition.engine.axis import Axis
from acquisition.engine.engine import Devices
from acquisition.rig import open_devices
from drivers.v4l2.settings import V4l2Settings
from instrument.config.load import Loaded, load_protocol
from instrument.config.protocol import References
from instrument.devices import Frame
from instrument.errors import DeviceError
from instrument.record.reading import Reading
from sim.emulated.v4l2.device import BadFrame, EmulatedCamera, Exposure
from sim.emulated.v4l2.server import V4l2Server
from sim.faults.faults import Faults
from sim.faults.triggers import Triggers, When
from sim.scene.scene import Scene
from sim.scene.sensor import Sensor
from tests.support import faulty_scan
from tests.support.faulty_scan import Ended, Watching, require_named
from tests.support.paths import CONFIGS
from tests.support.scans import changed, small_scan
from tests.support.v4l2.remote_camera import QUICK, SETTINGS, RemoteCamera

pytestmark = pytest.mark.waits

SIZE = (128, 102)
AT: dict[str, tuple[When, str, int]] = {
    "idle": ("at", "theta_r.identity", 1),
    "moving": ("after", "theta_r.start_move", 3),
    "exposing": ("after", "camera.set_exposure_s", 3),
    "reading": ("at", "camera.series", 2),
}
Strike = Callable[[EmulatedCamera], None]


@pytest.fixture(scope="module")
def short() -> Loaded:
    """Three points, nothing else; the camera is that of the emulated rig, made small."""
    demo = CONFIGS / "protocols" / "demo.yaml"
    rig = load_protocol(demo, CONFIGS / "rigs" / "emulated.yaml").rig
    scale = SIZE[0] / rig.camera.width_px
    camera = rig.camera.model_copy(
        update={
            "width_px": SIZE[0],
            "height_px": SIZE[1],
            "axis_row_px": rig.camera.axis_row_px * scale,
            "axis_column_px": rig.camera.axis_column_px * scale,
        }
    )
    sweep = {"theta_i_deg": [60.0], "dphi_deg": [0.0], "theta_r_deg": [-40.0, 0.0, 40.0]}
    return changed(
        small_scan(),
        rig={"camera": camera, "lamp": rig.lamp}, sweeps=[sweep], references=References(),
        frames_per_point=12,
    )  # fmt: skip


def settings(loaded: Loaded) -> V4l2Settings:
    camera = loaded.rig.camera
    return replace(
        SETTINGS,
        width_px=SIZE[0],
        height_px=SIZE[1],
        bit_depth=camera.bit_depth,
        min_exposure_s=camera.min_exposure_s,
        max_exposure_s=camera.max_exposure_s,
    )


class Relayed:
    """The camera of the child process; what its driver logs is logged here.

    More frames than one, asked for at once, are a moment of their own: a series.
    """

    def __init__(self, remote: RemoteCamera, triggers: Triggers) -> None:
        self._remote, self._triggers = remote, triggers

    def grab(self, count: int) -> list[Frame]:
        with self._triggers.call("camera.series" if count > 1 else "camera.single"):
            return self._asked("grab", count)  # type: ignore[no-any-return]  # over a pipe

    def set_exposure_s(self, exposure_s: float) -> float:
        return float(self._asked("set_exposure_s", exposure_s))

    def _asked(self, name: str, argument: float) -> Any:
        try:
            return self._remote.ask(name, argument)
        finally:
            for text in self._remote.ask("said"):
                logging.getLogger("drivers.v4l2.camera").warning(text)

    def identity(self) -> str:
        return self._remote.identity()

    def settings(self) -> dict[str, str]:
        return dict(self._remote.ask("settings"))


class Looking:
    """The scene, as the emulated camera sees it: as it was when an exposure began."""

    def __init__(self) -> None:
        self.scene: Scene | None = None

    def snapshot(self) -> object:
        if self.scene is None:
            return None
        seen = copy.copy(self.scene)
        seen.true_deg = dict(self.scene.true_deg)
        return seen

    def render(self, exposure: Exposure, seen: object) -> NDArray[Any]:
        """A sensor for each picture: the noise of a step is the same however many were dropped."""
        if not isinstance(seen, Scene) or len(seen.true_deg) < 3:
            return np.zeros((exposure.height_px, exposure.width_px), np.uint16)  # not homed yet
        return Sensor(seen).picture(exposure.exposure_s)


@contextmanager
def bench(
    loaded: Loaded, remote: RemoteCamera, triggers: Triggers
) -> Iterator[tuple[EmulatedCamera, Devices]]:
    """A new camera, opened, and the devices about it."""
    looking, faults = Looking(), Faults()
    camera = EmulatedCamera(looking.render, looking.snapshot, replace(QUICK, sizes=(SIZE,)))
    simulated = open_devices(changed(loaded, rig={"camera": small_scan().rig.camera}), faults)
    assert faults.scene is not None
    faults.scene.rig = loaded.rig
    looking.scene = faults.scene
    with V4l2Server(camera, remote.socket):
        remote.ask("open", settings(loaded))
        watched = Watching("camera", Relayed(remote, triggers), triggers)
        axes = dict(simulated.axes)
        stage = Watching("theta_r", axes["theta_r"]._stage, triggers)
        axes["theta_r"] = Axis("theta_r", stage, loaded.rig.axes.theta_r, simulated.clock)  # type: ignore[arg-type]  # passes all on
        try:
            yield camera, replace(simulated, axes=axes, camera=watched)  # type: ignore[arg-type]  # passes all on
        finally:
            remote.ask("close")


def scan(
    loaded: Loaded,
    remote: RemoteCamera,
    folder: Path,
    *happening: tuple[tuple[When, str, int], Strike],
) -> Ended:
    triggers = Triggers()
    with bench(loaded, remote, triggers) as (camera, devices):
        for moment, strike in happening:
            triggers.plan(*moment, lambda strike=strike: strike(camera))
        ended = faulty_scan.scan(loaded, folder, lambda: devices, triggers)
    assert triggers.pending == 0
    return ended


@pytest.fixture(scope="module")
def whole(
    short: Loaded, remote: RemoteCamera, tmp_path_factory: pytest.TempPathFactory
) -> list[Reading]:
    """The readings of a scan in which nothing failed."""
    ended = scan(short, remote, tmp_path_factory.mktemp("whole") / "run")
    assert ended.error is None
    assert all(reading.peak_dn > 1000 for reading in ended.readings)
    return ended.readings


def spoil_one(kind: BadFrame) -> Strike:
    """A frame that counts: those that were waiting when it was asked for have been dropped."""

    def strike(camera: EmulatedCamera) -> None:
        look, left = camera.snapshot, iter(range(6))

        def snapshot() -> object:
            if next(left, None) == 5:
                camera.faults.bad_frames.append(kind)
            return look()

        camera.snapshot = snapshot

    return strike


def spoil_all(camera: EmulatedCamera) -> None:
    camera.faults.bad_frames.extend(["flagged"] * 10_000)


def clamp(camera: EmulatedCamera) -> None:
    camera.faults.clamped_exposure = 1


def freeze(camera: EmulatedCamera) -> None:
    camera.faults.frozen = True


def thaw(camera: EmulatedCamera) -> None:
    camera.faults.frozen = False


@pytest.mark.parametrize("state", AT)
@pytest.mark.parametrize("kind", ["flagged", "short"])
def test_a_bad_frame_is_taken_anew(
    short: Loaded,
    remote: RemoteCamera,
    whole: list[Reading],
    tmp_path: Path,
    kind: BadFrame,
    state: str,
) -> None:
    ended = scan(short, remote, tmp_path / "run", (AT[state], spoil_one(kind)))
    assert ended.error is None
    assert ended.readings == whole
    if state == "reading":  # in the others it may have been one of the frames that are dropped
        assert any("taken anew" in text for text in ended.events["retry"])


@pytest.mark.parametrize("state", AT)
@pytest.mark.parametrize(
    ("strike", "heal"),
    [(EmulatedCamera.unplug, EmulatedCamera.replug), (freeze, thaw)],
    ids=["unplugged", "frozen"],
)
def test_a_camera_that_comes_back(
    short: Loaded,
    remote: RemoteCamera,
    whole: list[Reading],
    tmp_path: Path,
    strike: Strike,
    heal: Strike,
    state: str,
) -> None:
    """It is back when it is asked again: opened anew, set as before, each try in the record."""
    failed: list[EmulatedCamera] = []

    def back_at_the_next_try(camera: EmulatedCamera) -> None:
        strike(camera)
        failed.append(camera)

    with healing(failed, heal):
        ended = scan(short, remote, tmp_path / "run", (AT[state], back_at_the_next_try))
    assert ended.error is None
    assert ended.readings == whole
    assert any("try 2 of 4" in text for text in ended.events["retry"])


@contextmanager
def healing(failed: list[EmulatedCamera], heal: Strike) -> Iterator[None]:
    """Once the engine says that it tries again, the camera is back."""

    class Heal(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            if failed and "try 2 of" in record.getMessage():
                heal(failed.pop())

    log, handler = logging.getLogger("acquisition.engine.retrying_camera"), Heal()
    log.addHandler(handler)
    try:
        yield
    finally:
        log.removeHandler(handler)


STAYS: dict[str, tuple[Strike, str, str]] = {
    "bad frames": (spoil_all, "4 bad frames in a series", "moving"),
    "unplugged": (EmulatedCamera.unplug, "still so after 2 s", "reading"),
    "clamped": (clamp, "asked for, the camera took", "idle"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", STAYS)
def test_a_camera_that_stays_bad_is_named_and_the_scan_goes_on_with_a_sound_one(
    short: Loaded,
    remote: RemoteCamera,
    whole: list[Reading],
    tmp_path: Path,
    name: str,
    slow: bool,
) -> None:
    """In all states, or in the bounded form in one."""
    strike, says, one = STAYS[name]
    for state in AT if slow else [one]:
        folder = tmp_path / state
        ended = scan(short, remote, folder, (AT[state], strike))
        require_named(ended, DeviceError, f"camera.*{says}", folder)
        assert any(what in str(ended.error) for what in ("look at", "look whether", "ask for"))
        assert ended.readings == whole[: len(ended.readings)]
        again = scan(short, remote, folder)
        assert again.error is None
        assert again.readings == whole
