"""Options of the test run, and the fixtures that tests of several rooms share."""

from __future__ import annotations

import gc
import os
import shutil
import signal
import subprocess
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, settings

# Before NumPy: the arrays are small, and threads that wait for one another cost twice the time.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from instrument.config.load import Loaded, load_protocol
from sim.scene.render import electrons_per_s
from tests.support.analysis.no_charts import leave_charts_out
from tests.support.paths import CONFIGS
from tests.support.remembered_light import RememberedLight
from tests.support.storage.memory_folder import RAM, has_room
from tests.support.timing import standstill

if TYPE_CHECKING:
    from tests.support.v4l2.remote_camera import RemoteCamera

# How fast an example runs depends on the machine: speed is tested as ratios, elsewhere.
settings.register_profile("whole", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("bounded", settings.get_profile("whole"), max_examples=40)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--slow", action="store_true", help="run the long proofs whole")
    real = parser.getgroup("real devices", "tests marked hil")
    real.addoption("--allow-motion", action="store_true", help="the rig is clear: stages may move")
    real.addoption("--rig", type=Path, help="the rig file that names the real devices")
    real.addoption("--axis", action="append", help="an axis of it to move; default: all motors")


def pytest_configure(config: pytest.Config) -> None:
    """Choose the number of random examples, and undo what `nohup` and a shell's background do.

    With those, programs under test would ignore stops.
    """
    if has_room(RAM):
        os.environ.setdefault("PYTEST_DEBUG_TEMPROOT", str(RAM))
    settings.load_profile("whole" if config.getoption("--slow") else "bounded")
    defaults = {signal.SIGINT: signal.default_int_handler, signal.SIGHUP: signal.SIG_DFL,
                signal.SIGQUIT: signal.SIG_DFL}  # fmt: skip
    for number, default in defaults.items():
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, default)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """One more worker than cores: many tests wait for a process or a device now and then."""
    return len(os.sched_getaffinity(0)) + 1


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Tests and modules stay to the end: the garbage collector need not look at them again."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Long tests come first. Hardware stays untouched unless somebody stands by and has said so."""
    items.sort(key=lambda item: item.get_closest_marker("long") is None)
    if config.getoption("--allow-motion"):
        return
    refused = pytest.mark.skip(reason="real devices: not without --allow-motion")
    for item in items:
        if item.get_closest_marker("hil"):
            item.add_marker(refused)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool | None:
    """A test in real time that failed while the machine stood still is repeated."""
    if not standstill.is_repeated(item):
        return None
    standstill.run_in_real_time(item, nextitem)
    return True


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    reports = [r for kind in ("passed", "failed") for r in terminalreporter.getreports(kind)]
    for line in standstill.repetitions(reports):
        terminalreporter.write_line(line)


@pytest.fixture(scope="module", autouse=True)
def _charts_where_asked_for(request: pytest.FixtureRequest) -> Iterator[None]:
    """Reports made in this process have empty pictures, except in modules marked `charts`."""
    with pytest.MonkeyPatch.context() as patch:
        if not request.node.get_closest_marker("charts"):
            leave_charts_out(patch)
        yield


@pytest.fixture(scope="session", autouse=True)
def _scenes_rendered_once() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sim.scene.sensor.electrons_per_s", RememberedLight(electrons_per_s))
        yield


@pytest.fixture(scope="module")
def remote(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RemoteCamera]:
    """A child process that sees the emulated V4L2 camera."""
    from tests.support.v4l2.remote_camera import child

    with child(tmp_path_factory) as one:
        yield one


@pytest.fixture(scope="session")
def recorder(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The environment in which a process's writes are recorded: see `write_recorder.c`."""
    return {"LD_PRELOAD": _preloaded("write_recorder", tmp_path_factory)}


@pytest.fixture(scope="session")
def hung_disk(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The environment in which a disk hangs while a file is there: see `hung_disk.c`."""
    flag = tmp_path_factory.mktemp("disk") / "hung"
    return {
        "LD_PRELOAD": _preloaded("hung_disk", tmp_path_factory),
        "GONIO_HUNG_DISK": str(flag),
    }


def _preloaded(name: str, tmp_path_factory: pytest.TempPathFactory) -> str:
    """Compile a library of `support/storage` and return its path."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip(f"no C compiler: {name} cannot be made (Debian: gcc, libc6-dev)")
    library = tmp_path_factory.mktemp(name) / f"{name}.so"
    source = Path(__file__).with_name("support") / "storage" / f"{name}.c"
    options = ["-O1", "-Wall", "-Werror", "-shared", "-fPIC"]
    subprocess.run([compiler, *options, "-o", library, source, "-ldl"], check=True, timeout=60)
    return str(library)


@pytest.fixture
def slow(request: pytest.FixtureRequest) -> bool:
    return bool(request.config.getoption("--slow"))


@pytest.fixture(scope="session")
def demo() -> Loaded:
    return load_protocol(CONFIGS / "protocols" / "demo.yaml")
