"""Runs to be mapped: with frames, with cells, without either, and one that is damaged."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from instrument.record.record import FILE_NAME
from tests.support.command import finished_run, gonio_here
from tests.support.scans import small_demo

CELL_MM = 4.0
FRAMES, CELLS, WITHOUT, DAMAGED = "day 1/frames", "day 1/cells", "without", "damaged"
_FILES = "map.npz", "map.html", "map.nxs", "report.html"
_OPTIONS = ("--cell-mm", CELL_MM, "--nexus", "--json")
PAIR = (DAMAGED, FRAMES)


def write_runs(folder: Path) -> Path:
    """Measure the runs, small ones of the demonstration's foam; return the folder."""
    for name, kept in ((FRAMES, "keep_frames: true"), (CELLS, f"maps: {{cell_mm: {CELL_MM}}}")):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        protocol = small_demo(folder, "oren_nayar" if name == FRAMES else "lambert")
        protocol.write_text(f"{protocol.read_text().replace('num: 9', 'num: 5')}{kept}\n")
        finished_run(protocol, folder / name)
    (folder / WITHOUT).mkdir()
    (folder / WITHOUT / FILE_NAME).write_bytes((folder / CELLS / FILE_NAME).read_bytes())
    (folder / DAMAGED / "frames").mkdir(parents=True)
    (folder / DAMAGED / FILE_NAME).write_bytes(b"no database")
    return folder


def copied(measured: Path, names: Sequence[str], folder: Path) -> Path:
    """Copy some of the runs into a new folder, and return it."""
    for name in names:
        shutil.copytree(measured / name, folder / name)
    return folder


@dataclass(frozen=True, slots=True)
class Mapped:
    """What `gonio map` of one run gave: its exit code, its JSON and the files by name."""

    exit_code: int
    text: str
    files: dict[str, bytes]


def mapped_alone(measured: Path, folder: Path) -> dict[str, Mapped]:
    """Map two runs, of which one is damaged, each alone; return the outcomes by name."""
    copied(measured, PAIR, folder)
    found = {}
    for name in PAIR:
        done = gonio_here("map", name, *_OPTIONS, cwd=folder)
        found[name] = Mapped(done.returncode, done.stdout.strip(), contents(folder / name))
    return found


def mapped_together(measured: Path, folder: Path, *options: object) -> dict[str, Mapped]:
    """Map the same runs by one command with these options; return the outcomes by name."""
    copied(measured, PAIR, folder)
    done = gonio_here("map", "--all", ".", *_OPTIONS, *options, cwd=folder)
    assert done.returncode == 2, done.stderr
    told = json.loads(done.stdout)
    assert told["complete"]
    found = {}
    for result in told["results"]:
        text = "" if result["map"] is None else json.dumps(result["map"])
        name = result["source"]
        found[name] = Mapped(result["exit_code"], text, contents(folder / name))
    return found


def contents(run: Path) -> dict[str, bytes]:
    """Content of the files of a run's map and of its report, by name."""
    return {name: (run / name).read_bytes() for name in _FILES if (run / name).is_file()}
