"""Contract of every camera: simulated, V4L2 on the emulated device, and a real one.

A real camera is tested with `--allow-motion --rig FILE`, by the settings of its rig file. It needs
light that does not flicker, enough to saturate it.
"""

from __future__ import annotations

import os
import runpy
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from numpy.typing import NDArray

from drivers.factory import open_camera, v4l2_settings
from instrument.clock import SystemClock
from instrument.config.camera import CameraConfig, CameraDefects, V4l2CameraConfig
from instrument.config.load import load_rig
from instrument.devices import Camera
from sim.clock import SimulatedClock
from sim.emulated.v4l2.device import Exposure
from sim.scene.camera import SimulatedCamera
from tests.support.paths import CONFIGS, ROOT
from tests.support.scans import simulated_scene, small_scan
from tests.support.v4l2.camera_contract import CHECKS, Check
from tests.support.v4l2.remote_camera import DEVICE, QUICK, RemoteCamera, child, served

pytestmark = pytest.mark.real_time

Tested = tuple[Camera, CameraConfig]
WIDTH, HEIGHT = 64, 48


def emulated_config(**changes: Any) -> V4l2CameraConfig:
    """Camera of the emulated rig with few pixels, and other changes."""
    config = load_rig(CONFIGS / "rigs" / "emulated.yaml").camera
    size = {
        "width_px": WIDTH, "height_px": HEIGHT, "axis_row_px": 24.0, "axis_column_px": 32.0,
        "device": DEVICE, "frames_per_s": None,
    }  # fmt: skip
    return V4l2CameraConfig.model_validate({**config.model_dump(), **size, **changes})


class Surface:
    """Evenly lit surface with shading and noise; `saturated_s`: exposure at which it saturates."""

    def __init__(self, config: CameraConfig, saturated_s: float = 0.06) -> None:
        self._config, self._random = config, np.random.default_rng(3)
        self._saturated_s = saturated_s
        self._shading = np.linspace(0.8, 1.0, WIDTH)[None, :].repeat(HEIGHT, axis=0)

    def snapshot(self) -> object:
        return None

    def render(self, exposure: Exposure, _: object) -> NDArray[Any]:
        black, full = self._config.black_level_dn, 2**self._config.bit_depth - 1
        light = self._shading * (full - black) * exposure.exposure_s / self._saturated_s
        counts = black + light + self._random.normal(0, 0.3 + 0.02 * np.sqrt(light))
        kind = np.uint8 if self._config.bit_depth == 8 else np.uint16
        return np.clip(np.rint(counts), 0, full).astype(kind)


@pytest.fixture(
    scope="module", params=["simulated", "v4l2", pytest.param("real", marks=pytest.mark.hil)]
)
def tested(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Tested]:
    if request.param == "simulated":
        loaded = small_scan()
        yield SimulatedCamera(simulated_scene(loaded, 30.0), SimulatedClock()), loaded.rig.camera
    elif request.param == "v4l2":
        config = emulated_config()
        with child(tmp_path_factory) as remote:
            surface = Surface(config)
            with served(remote, surface, QUICK):  # type: ignore[arg-type]  # another picture
                remote.ask("open", v4l2_settings(config, DEVICE))
                yield remote, config  # type: ignore[misc]  # closed with its process
    else:
        rig = request.config.getoption("--rig")
        if rig is None:
            pytest.skip("no real camera: --allow-motion --rig FILE")
        real = load_rig(rig).camera
        assert isinstance(real, V4l2CameraConfig), f"{rig}: its camera is {real.driver}, not v4l2"
        camera = open_camera(real, real.device, SystemClock())
        try:
            yield camera, real
        finally:
            camera.close()


@pytest.mark.parametrize("check", CHECKS.values(), ids=CHECKS)
def test_a_camera_keeps_the_contract(tested: Tested, check: Check) -> None:
    check(*tested)


STEPS_OF_1_6_MS = [0.0016 * n for n in range(1, 100)]
DEFECTIVE: dict[str, tuple[str, dict[str, Any], dict[str, Any]]] = {
    "ignores the control": ("linearity", {}, {"fixed_exposure_s": 0.03}),
    "is limited by its frame": ("linearity", {}, {"longest_exposure_s": 0.015}),
    "rounds in silence": ("linearity", {}, {"exposures_s": STEPS_OF_1_6_MS}),
    "is late by four frames": ("first_frame", {"delay_frames": 4}, {}),
    "has limited range": ("saturation", {}, {"limited_range": "undeclared"}),
}


@pytest.mark.parametrize("kind", DEFECTIVE)
def test_a_defective_camera_fails_the_contract(remote: RemoteCamera, kind: str) -> None:
    """The control reads back what was set, and the frames are labelled with it."""
    check, capabilities, defects = DEFECTIVE[kind]
    config = emulated_config(
        pixel_format="GREY", bit_depth=8, black_level_dn=8.0, read_noise_electrons=60.0
    )
    # Four frames last longer than a busy machine keeps this process waiting.
    surface = Surface(config, 0.24 if "delay_frames" in capabilities else 0.06)
    faulty = CameraDefects.model_validate(defects)
    with served(remote, surface, QUICK, defects=faulty, **capabilities):  # type: ignore[arg-type]  # another picture
        remote.ask("open", v4l2_settings(config, DEVICE))
        with pytest.raises(AssertionError, match=r"not proportional|no light f|frame by|stays at"):
            CHECKS[check](remote, config)  # type: ignore[arg-type]  # a camera over a pipe


def test_no_test_of_a_camera_is_left_out_as_a_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a compiler only the emulated cameras are skipped."""
    monkeypatch.setenv("PATH", "/nowhere")
    runpy.run_path(str(ROOT / "tests" / "support" / "v4l2" / "remote_camera.py"))


@pytest.mark.slow
def test_a_real_camera_needs_no_compiler(tmp_path: Path, slow: bool) -> None:
    """The camera of the rig file is opened, and not there."""
    if not slow:
        pytest.skip("a second pytest takes seconds: with --slow")
    rig = yaml.safe_load((CONFIGS / "rigs" / "emulated.yaml").read_text())
    hand = {"driver": "hand", "min_deg": 0.0, "max_deg": 80.0, "u_deg": 0.1}
    rig["axes"] = {name: dict(hand) for name in rig["axes"]}
    rig["camera"]["device"] = "/dev/nowhere"
    rig["lamp"] = {"driver": "manual", "darkened_by": "hand", "white_electrons_per_s": 1e6}
    path = tmp_path / "rig.yaml"
    path.write_text(yaml.safe_dump(rig))
    options = ["-q", "-p", "no:cacheprovider", "-m", "hil", "-k", "identity", "--allow-motion"]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *options, "--rig", str(path), __file__],
        cwd=ROOT, env={**os.environ, "PATH": "/nowhere"}, capture_output=True, text=True,
        timeout=120, check=False,
    )  # fmt: skip
    assert "camera /dev/nowhere: cannot be opened" in done.stdout
    assert "skipped" not in done.stdout
