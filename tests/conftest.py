"""Shared by all tests: the shipped configuration and what the command line asks for."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import HealthCheck, settings

# Before NumPy: the arrays are small, and threads that wait for one another cost twice the time.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from instrument.config import Loaded, load_protocol
from instrument.rig_config import Rig

if TYPE_CHECKING:
    from v4l2_rig import RemoteCamera

ROOT = Path(__file__).resolve().parent.parent
CONFIGS = ROOT / "configs"

# How fast an example runs depends on the machine: speed is tested as ratios, elsewhere.
settings.register_profile(
    "any machine", deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("any machine")


def cpu_seconds(action: Callable[[], object], repeats: int) -> float:
    """Least CPU time of one call: what else runs on the machine only adds to it."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        action()
        times.append(time.process_time() - start)
    return min(times)


def gonio(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run the command from the project's folder, with nobody at its terminal."""
    return subprocess.run(
        [sys.executable, "-m", "acquisition", *map(str, arguments)],
        cwd=ROOT, capture_output=True, text=True, timeout=300, check=False,
        stdin=subprocess.DEVNULL,
    )  # fmt: skip


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--slow", action="store_true", help="run the long proofs whole")
    real = parser.getgroup("real devices", "tests marked hil")
    real.addoption("--allow-motion", action="store_true", help="the rig is clear: stages may move")
    real.addoption("--stage-port", help="of a real stage: /dev/serial/by-id/..., tcp://host:port")
    real.addoption("--stage-driver", default="newport", choices=["newport", "oriental", "zaber"])
    real.addoption("--stage-scale", type=float, default=1000.0, help="steps a degree")
    real.addoption("--camera", help="of a real camera: /dev/v4l/by-id/...")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Hardware stays untouched unless somebody stands by and has said so."""
    if config.getoption("--allow-motion"):
        return
    refused = pytest.mark.skip(reason="real devices: not without --allow-motion")
    for item in items:
        if item.get_closest_marker("hil"):
            item.add_marker(refused)


@pytest.fixture(scope="module")
def remote(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RemoteCamera]:
    """A child process that sees the emulated V4L2 camera."""
    from v4l2_rig import child

    with child(tmp_path_factory) as one:
        yield one


@pytest.fixture(scope="session")
def recorder(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The environment in which a process's writes are recorded: see `write_recorder.c`."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler: the write recorder cannot be made (Debian: gcc, libc6-dev)")
    library = tmp_path_factory.mktemp("recorder") / "write_recorder.so"
    source = Path(__file__).with_name("write_recorder.c")
    options = ["-O1", "-Wall", "-Werror", "-shared", "-fPIC"]
    subprocess.run([compiler, *options, "-o", library, source, "-ldl"], check=True, timeout=60)
    return {"LD_PRELOAD": str(library)}


def small_demo(folder: Path) -> Path:
    """The demo's protocol in that folder, with two incidences and nine view angles."""
    text = (CONFIGS / "protocols" / "demo.yaml").read_text()
    text = text.replace("[30.0, 45.0, 60.0]", "[30.0, 60.0]").replace("num: 33", "num: 9")
    path = folder / "small.yaml"
    path.write_text(text.replace("../rigs/", f"{CONFIGS / 'rigs'}/"))
    return path


@pytest.fixture
def slow(request: pytest.FixtureRequest) -> bool:
    return bool(request.config.getoption("--slow"))


@pytest.fixture(scope="session")
def demo() -> Loaded:
    return load_protocol(CONFIGS / "protocols" / "demo.yaml")


def changed(loaded: Loaded, rig: dict[str, Any] | None = None, **protocol: Any) -> Loaded:
    """The same configuration with some entries replaced (not validated again)."""
    return replace(
        loaded,
        rig=loaded.rig.model_copy(update=rig or {}),
        protocol=loaded.protocol.model_copy(update=protocol),
    )


def exact_rig(rig: Rig) -> Rig:
    """The rig as its file says it is: true angles, sample on the axis, a constant lamp."""
    axes = rig.axes.model_copy(
        update={
            n: rig.axes[n].model_copy(update={"u_deg": 0.0}) for n in ("theta_i", "dphi", "theta_r")
        }
    )
    simulation = rig.simulation.model_copy(
        update={"sample_height_mm": 0.0, "lamp_drift_per_hour": 0.0}
    )
    return rig.model_copy(update={"axes": axes, "simulation": simulation})
