"""Faults of a V4L2 camera during a scan: recovery or a clear stop, never a wrong value.

The driver runs in a child process over an emulated camera that renders the simulated scene; stage,
lamp and operator are simulated. The driver's log messages are logged again here, for the record.
"""

from __future__ import annotations

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
from tests.support.paths import CONFIGS
from tests.support.scans import changed, small_scan
from tests.support.v4l2.remote_camera import QUICK, SETTINGS, RemoteCamera
from tests.support.whole_scans import faulty_scan
from tests.support.whole_scans.faulty_scan import ScanResult, WatchedDevice, require_reported

pytestmark = pytest.mark.waits

SIZE = (128, 102)
STATES: dict[str, tuple[When, str, int]] = {
    "idle": ("at", "theta_r.identity", 1),
    "moving": ("after", "theta_r.start_move", 3),
    "exposing": ("after", "camera.set_exposure_s", 3),
    "reading": ("at", "camera.series", 2),
}
_SPACING, _FIRST, _ELEVENS = 11, 6, 10_000
MakeFail = Callable[[EmulatedCamera], None]


@pytest.fixture(scope="module")
def short() -> Loaded:
    """A scan of three points only, with the emulated rig's camera at reduced size."""
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


class RelayedCamera:
    """Camera of the child process; logs the messages of its driver here.

    Calls are counted as `camera.series` for several frames and `camera.single` for one.
    """

    def __init__(self, remote: RemoteCamera, triggers: Triggers) -> None:
        self._remote, self._triggers = remote, triggers

    def grab(self, count: int) -> list[Frame]:
        with self._triggers.call("camera.series" if count > 1 else "camera.single"):
            return self._ask("grab", count)  # type: ignore[no-any-return]  # over a pipe

    def set_exposure_s(self, exposure_s: float) -> float:
        return float(self._ask("set_exposure_s", exposure_s))

    def _ask(self, name: str, argument: float) -> Any:
        try:
            return self._remote.ask(name, argument)
        finally:
            for text in self._remote.ask("said"):
                logging.getLogger("drivers.v4l2.camera").warning(text)

    def identity(self) -> str:
        return self._remote.identity()

    def settings(self) -> dict[str, str]:
        return dict(self._remote.ask("settings"))


class SceneRenderer:
    """Renders the scene as it was at the start of each exposure."""

    def __init__(self) -> None:
        self.scene: Scene | None = None

    def snapshot(self) -> object:
        if self.scene is None:
            return None
        return replace(self.scene, true_deg=dict(self.scene.true_deg))

    def render(self, exposure: Exposure, snapshot: object) -> NDArray[Any]:
        """Use a new sensor for each image: its noise must not depend on dropped frames.

        The first row, outside the window, is the frame's number: no two frames are equal.
        """
        if not isinstance(snapshot, Scene) or len(snapshot.true_deg) < 3:
            return np.zeros((exposure.height_px, exposure.width_px), np.uint16)  # not homed yet
        image = Sensor(snapshot).picture(exposure.exposure_s)
        image[0] = exposure.sequence % 4096
        return image


@contextmanager
def opened_rig(
    loaded: Loaded, remote: RemoteCamera, triggers: Triggers
) -> Iterator[tuple[EmulatedCamera, Devices]]:
    """A new emulated camera with its driver open, and the other devices simulated."""
    renderer, faults = SceneRenderer(), Faults()
    camera = EmulatedCamera(renderer.render, renderer.snapshot, replace(QUICK, sizes=(SIZE,)))
    simulated = open_devices(changed(loaded, rig={"camera": small_scan().rig.camera}), faults)
    assert faults.scene is not None
    faults.scene.rig = loaded.rig
    renderer.scene = faults.scene
    with V4l2Server(camera, remote.socket):
        remote.ask("open", settings(loaded))
        watched = WatchedDevice("camera", RelayedCamera(remote, triggers), triggers)
        axes = dict(simulated.axes)
        stage = WatchedDevice("theta_r", axes["theta_r"]._stage, triggers)
        axes["theta_r"] = Axis("theta_r", stage, loaded.rig.axes.theta_r, simulated.clock)  # type: ignore[arg-type]  # forwards everything
        try:
            yield camera, replace(simulated, axes=axes, camera=watched)  # type: ignore[arg-type]  # forwards everything
        finally:
            remote.ask("close")


def scan(
    loaded: Loaded,
    remote: RemoteCamera,
    folder: Path,
    *planned: tuple[tuple[When, str, int], MakeFail],
) -> ScanResult:
    triggers = Triggers()
    with opened_rig(loaded, remote, triggers) as (camera, devices):
        for trigger, make_fail in planned:
            triggers.plan(*trigger, lambda make_fail=make_fail: make_fail(camera))
        result = faulty_scan.scan(loaded, folder, lambda: devices, triggers)
    assert triggers.pending == 0
    return result


@pytest.fixture(scope="module")
def whole(
    short: Loaded, remote: RemoteCamera, tmp_path_factory: pytest.TempPathFactory
) -> list[Reading]:
    """Readings of the undisturbed scan."""
    result = scan(short, remote, tmp_path_factory.mktemp("whole") / "run")
    assert result.error is None
    assert all(reading.peak_dn > 1000 for reading in result.readings)
    return result.readings


def bad_frames(kind: BadFrame) -> MakeFail:
    """Spoil every eleventh frame from the sixth on: at least one of a series' twelve is among them.

    Counted are frames that reach a buffer: where the machine is busy others are lost before.
    """
    eleven = [*[None] * (_FIRST - 1), kind, *[None] * (_SPACING - _FIRST)]
    return lambda camera: camera.faults.bad_frames.extend(eleven * _ELEVENS)


def all_frames_bad(camera: EmulatedCamera) -> None:
    camera.faults.bad_frames.extend(["flagged"] * 10_000)


def clamp_exposure(camera: EmulatedCamera) -> None:
    camera.faults.clamped_exposure = 1


def freeze(camera: EmulatedCamera) -> None:
    camera.faults.frozen = True


def unfreeze(camera: EmulatedCamera) -> None:
    camera.faults.frozen = False


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("kind", ["flagged", "short"])
def test_a_bad_frame_is_retaken(
    short: Loaded,
    remote: RemoteCamera,
    whole: list[Reading],
    tmp_path: Path,
    kind: BadFrame,
    state: str,
) -> None:
    result = scan(short, remote, tmp_path / "run", (STATES[state], bad_frames(kind)))
    assert result.error is None
    assert result.readings == whole
    assert any("taken again" in text for text in result.events["retry"])


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize(
    ("make_fail", "repair"),
    [(EmulatedCamera.unplug, EmulatedCamera.replug), (freeze, unfreeze)],
    ids=["unplugged", "frozen"],
)
def test_a_camera_that_returns(
    short: Loaded,
    remote: RemoteCamera,
    whole: list[Reading],
    tmp_path: Path,
    make_fail: MakeFail,
    repair: MakeFail,
    state: str,
) -> None:
    """It is reopened with its settings; the record has one event at the loss, one at the return."""
    failed: list[EmulatedCamera] = []

    def fail_until_retry(camera: EmulatedCamera) -> None:
        make_fail(camera)
        failed.append(camera)

    with repair_at_retry(failed, repair):
        result = scan(short, remote, tmp_path / "run", (STATES[state], fail_until_retry))
    assert result.error is None
    assert result.readings == whole
    lost, back = result.events["retry"]
    assert lost.endswith("waiting for it for up to 30 s")
    assert back.startswith("camera: back after")


@contextmanager
def repair_at_retry(failed: list[EmulatedCamera], repair: MakeFail) -> Iterator[None]:
    """Repair the camera once the engine logs that it waits."""

    class RepairHandler(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            if failed and "waiting for it" in record.getMessage():
                repair(failed.pop())

    log, handler = logging.getLogger("acquisition.engine.retrying_camera"), RepairHandler()
    log.addHandler(handler)
    try:
        yield
    finally:
        log.removeHandler(handler)


LASTING: dict[str, tuple[MakeFail, str, str]] = {
    "bad frames": (all_frames_bad, "4 bad frames in a series", "moving"),
    "unplugged": (EmulatedCamera.unplug, "waited for 30 s", "reading"),
    "clamped": (clamp_exposure, "asked for, the camera took", "idle"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", LASTING)
def test_a_lasting_fault_is_reported_and_the_scan_resumes_with_a_sound_camera(
    short: Loaded,
    remote: RemoteCamera,
    whole: list[Reading],
    tmp_path: Path,
    name: str,
    slow: bool,
) -> None:
    """In one state; with --slow in all."""
    make_fail, message, one = LASTING[name]
    for state in STATES if slow else [one]:
        folder = tmp_path / state
        result = scan(short, remote, folder, (STATES[state], make_fail))
        require_reported(result, DeviceError, f"camera.*{message}", folder)
        assert any(what in str(result.error) for what in ("look at", "look whether", "ask for"))
        assert result.readings == whole[: len(result.readings)]
        resumed = scan(short, remote, folder)
        assert resumed.error is None
        assert resumed.readings == whole
