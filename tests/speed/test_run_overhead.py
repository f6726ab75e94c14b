"""Time of the demonstration beyond the simulated camera's frames: start-up, scan, fit, report.

The figures are recorded with the test (`--junit-xml`, or `-s` prints them); only a ratio can fail.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.support.paths import CONFIGS
from tests.support.scans import small_demo

# Runs the command as `gonio` does, and adds up the time inside the camera.
RUN = """
import json, sys, time
from acquisition.cli import main
from sim.scene.camera import SimulatedCamera

grab, spent = SimulatedCamera.grab, [0.0, 0.0]
def timed(camera, count):
    wall, cpu = time.perf_counter(), time.process_time()
    frames = grab(camera, count)
    spent[0] += time.perf_counter() - wall
    spent[1] += time.process_time() - cpu
    return frames
SimulatedCamera.grab = timed

times, *sys.argv[1:] = sys.argv[1:]
try:
    main()
finally:
    with open(times, "w") as file:
        json.dump(spent, file)
"""
LIBRARIES = "import cv2, matplotlib.figure, numpy, pydantic, rich.progress, typer, yaml"


class Seconds(NamedTuple):
    wall: float
    cpu: float


def seconds(*arguments: object) -> Seconds:
    """Wall and CPU time of a Python process; its linear algebra has one thread, as `gonio` has."""
    wall, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        [sys.executable, "-c", *map(str, arguments)],
        check=True, capture_output=True, env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )  # fmt: skip
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Seconds(time.perf_counter() - wall, cpu)


def overhead(folder: Path, protocol: Path) -> Seconds:
    """Time of the protocol's process less that of its frames."""
    times = folder / "frames.json"
    whole = seconds(RUN, times, "run", protocol, "--out", folder / "run")
    assert (folder / "run" / "report.html").exists()
    frames = Seconds(*json.loads(times.read_text()))
    return Seconds(whole.wall - frames.wall, whole.cpu - frames.cpu)


@pytest.mark.slow
def test_the_demonstration_costs_a_few_times_the_import_of_its_libraries(
    tmp_path: Path, slow: bool, record_property: Callable[[str, object], None]
) -> None:
    """Measured on one core of 2 GHz: 4.8 s, of which the libraries' imports are 0.78 s.

    The interlocks take 1.7 s of it, 15 ms for each series of frames: they look at its picture. The
    report's charts, drawn for two widths, take 1.2 s. A busy machine slows the parts unequally.
    Without --slow with a sixth of the points and small pictures: what is left is not the scan, and
    takes some 3 times the imports, on a busy machine up to 6, as each is measured once.
    """
    found = []
    protocol = CONFIGS / "protocols" / "demo.yaml" if slow else small_demo(tmp_path)
    for n in range(5 if slow else 1):
        (tmp_path / str(n)).mkdir()
        found.append(overhead(tmp_path / str(n), protocol))
    libraries = min(seconds(LIBRARIES).cpu for _ in range(3 if slow else 1))
    wall_s, cpu_s = min(f.wall for f in found), min(f.cpu for f in found)
    figures = {"overhead_wall_s": wall_s, "overhead_cpu_s": cpu_s, "libraries_cpu_s": libraries}
    for name, value in figures.items():
        record_property(name, f"{value:.2f}")
        sys.stdout.write(f"{name} {value:.2f}\n")
    assert cpu_s < 10 * libraries
