"""Speed-up of `gonio fit --all` by processes, and the share of its work that is serial.

`python -m tests.support.speed_up.speed_up FOLDER` measures on a machine that does nothing else
(two minutes on one core of 2024) and writes speed_up.svg and speed_up.csv into FOLDER, a new one.
"""

from __future__ import annotations

import csv
import io
import resource
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from acquisition.batch.processes import cores, on_processes
from acquisition.batch.summary import Outcome
from acquisition.benchmark.output.files import empty_folder
from acquisition.commands.fit import Asked
from acquisition.commands.many.fit_all import keep_files
from acquisition.commands.many.fits_table import as_csv
from acquisition.commands.many.one_fit import fit_one
from acquisition.results.sources import Wanted
from analysis.models import MODELS
from instrument.geometry import Geometry
from instrument.text.atomic_file import write_whole

SOURCES = 24
_VIEWS_DEG = np.arange(-75.0, 76.0, 5.0)
_INCIDENCES_DEG = (0.0, 30.0, 45.0, 60.0)
_U = 0.01  # relative, of each value


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """Time of all fits with a number of processes.

    wall_s: from the start of the first process to the end of the last. serial_s: CPU time of the
    main process, which hands out the sources and writes the files: it does not shrink with more
    processes. work_s: CPU time of the processes, their start included. fits: by source.
    """

    workers: int
    wall_s: float
    serial_s: float
    work_s: float
    fits: dict[str, object]


def write_tables(folder: Path, count: int, seed: int = 0) -> dict[str, Path]:
    """Write tables of rough samples with random parameters; return their paths by name."""
    random = np.random.default_rng(seed)
    theta_i, theta_r = (a.ravel() for a in np.meshgrid(_INCIDENCES_DEG, _VIEWS_DEG, indexing="ij"))
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=0.0)
    found = {}
    for n in range(count):
        albedo, sigma_deg = random.uniform(0.2, 0.9), random.uniform(10.0, 40.0)
        f = MODELS["oren_nayar"].brdf(geometry, albedo=albedo, sigma_deg=sigma_deg)
        f = f * (1 + _U * random.standard_normal(f.size))
        rows = [f"{i},{r},0,{v},{_U * v}\n" for i, r, v in zip(theta_i, theta_r, f, strict=True)]
        path = folder / f"{n:03d}.csv"
        path.write_text("theta_i_deg,theta_r_deg,dphi_deg,brdf,u_brdf\n" + "".join(rows))
        found[path.name] = path
    return found


def timing(sources: dict[str, Path], workers: int, asked: Asked, out: Path) -> Timing:
    """Fit all sources as `gonio fit --all --out` does, and measure it."""
    work = partial(fit_one, asked=asked, report=True)
    outcomes: list[Outcome] = []
    begun_s = _clocks()
    for _, outcome in on_processes(work, list(sources.items()), workers):
        if not isinstance(outcome, Outcome) or outcome.result is None:
            raise RuntimeError(f"{outcome}: a benchmark's source was not fitted")
        keep_files(out, outcome)
        outcomes.append(outcome)
    as_csv(outcomes)
    wall_s, serial_s, work_s = (end - begin for end, begin in zip(_clocks(), begun_s, strict=True))
    fits = {o.source: o.result for o in sorted(outcomes, key=lambda o: o.source)}
    return Timing(workers=workers, wall_s=wall_s, serial_s=serial_s, work_s=work_s, fits=fits)


def _clocks() -> tuple[float, float, float]:
    """Seconds of the wall, of this process's CPU time, and of that of its ended children."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.perf_counter(), time.process_time(), children.ru_utime + children.ru_stime


def serial_share(one: Timing) -> float:
    """Share of the CPU time that is serial, which other load on the machine hardly changes."""
    return one.serial_s / (one.serial_s + one.work_s)


def speed_up(serial: float, workers: float) -> float:
    """Speed-up by Amdahl's law (AFIPS 1967): the serial share stays, the rest is divided."""
    return 1 / (serial + (1 - serial) / workers)


def measure(counts: Sequence[int], sources: int, asked: Asked) -> list[Timing]:
    """Measure with each number of processes; the fits must be the same bit for bit."""
    found = []
    with TemporaryDirectory(prefix="gonio-many-") as scratch:
        tables = write_tables(Path(scratch), sources)
        for workers in counts:
            out = Path(scratch, f"out_{workers}")
            found.append(timing(tables, workers, asked, out))
            if found[-1].fits != found[0].fits:
                raise RuntimeError(f"{workers} processes: fits differ from those of {counts[0]}")
    return found


def table(timings: Sequence[Timing]) -> str:
    """Return the timings as CSV."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["workers", "sources", "wall_s", "serial_s", "work_s", "speed_up"])
    for t in timings:
        ratio = timings[0].wall_s / t.wall_s
        times = [f"{value:.3f}" for value in (t.wall_s, t.serial_s, t.work_s, ratio)]
        writer.writerow([t.workers, len(t.fits), *times])
    return text.getvalue()


def main(folder: Path) -> None:
    """Measure with one process and with as many as there are cores, and write the files."""
    from tests.support.speed_up.chart import chart  # heavy: the charts' library

    empty_folder(folder)
    timings = measure(sorted({1, 2, cores()}), SOURCES, Asked(wanted=Wanted()))
    write_whole(folder / "speed_up.csv", table(timings))
    write_whole(folder / "speed_up.svg", chart(timings))
    share = serial_share(timings[0])
    sys.stdout.write(
        f"{table(timings)}serial: {100 * share:.2g} %; 100 processes: {speed_up(share, 100):.0f} "
        "times as fast\n"
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
