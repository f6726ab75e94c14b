"""Accepted readings survive a power cut, whatever else the disk has kept."""

from __future__ import annotations

import random
import shutil
import sqlite3
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import pytest

from instrument.errors import InputError
from instrument.record.reading import Reading
from instrument.record.record import FILE_NAME, Record
from tests.support.scans import small_scan
from tests.support.storage.killer_process import run_scan_killer
from tests.support.storage.power_cut import MARK, Disk, Entry, entries


@pytest.fixture(scope="module")
def log(recorder: dict[str, str], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Log of all file operations of a scan that keeps frames and was stopped and resumed once."""
    folder = tmp_path_factory.mktemp("power cut")
    (folder / "disk").mkdir()
    environment = recorder | {"GONIO_RECORD_ROOT": str(folder / "disk")}
    run_scan_killer([folder / "disk", "record", folder / "log"], environment, 120)
    return folder / "log"


def cuts(log: Path, every: int) -> Iterator[tuple[int, Disk]]:
    """Yield the disk after every n-th entry, and after each that accepts a reading."""
    disk = Disk()
    for number, entry in enumerate(entries(log)):
        disk.do(entry)
        if number % every == 0 or entry.kind == MARK:
            yield number, disk


def look(run: Path, accepted: set[int], whole: dict[int, Reading]) -> None:
    try:
        record = Record.open(run)
    except InputError:
        assert not accepted
        return
    with record:
        readings = record.readings()
        files = record.frame_files()
    assert accepted <= {r.step for r in readings}
    assert all(replace(r, time_utc="") == whole[r.step] for r in readings)
    shape = small_scan().rig.camera.height_px, small_scan().rig.camera.width_px
    for name in files:
        assert cv2.imread(str(run / name), cv2.IMREAD_UNCHANGED).shape == shape
    with sqlite3.connect(run / FILE_NAME) as database:
        assert database.execute("PRAGMA integrity_check").fetchone() == ("ok",)
    database.close()


@pytest.mark.slow
def test_all_accepted_readings_survive_a_power_cut_at_any_moment(
    log: Path, tmp_path: Path, slow: bool, record_testsuite_property: Callable[[str, object], None]
) -> None:
    root, draws = str(log.parent / "disk"), 4 if slow else 1
    with Record.open(Path(root) / "deep" / "run") as record:
        whole = {r.step: replace(r, time_utc="") for r in record.readings()}
    looked = 0
    for number, disk in cuts(log, 1 if slow else 80):
        for draw in (None, *(random.Random(1000 * number + n) for n in range(draws))):
            left = tmp_path / "left"
            left.mkdir()
            disk.cut(left, root, draw)
            look(left / "deep" / "run", disk.accepted, whole)
            shutil.rmtree(left)
            looked += 1
    assert disk.accepted == set(whole)
    record_testsuite_property("power cuts", looked)


def test_the_simulated_disk_keeps_only_what_was_synced(tmp_path: Path) -> None:
    """A file exists once it and its folder were synced, with its contents at that time."""

    def left(*done: Entry) -> dict[str, bytes]:
        disk = Disk()
        for entry in done:
            disk.do(entry)
        folder = tmp_path / str(len(list(tmp_path.iterdir())))
        folder.mkdir()
        disk.cut(folder, "/root", None)
        return {p.name: p.read_bytes() for p in folder.iterdir()}

    create = Entry(1, 7, 0, 0, ("/root/a",), b"")
    write = Entry(2, 7, 0, 3, ("",), b"abc")
    more = Entry(2, 7, 3, 3, ("",), b"def")
    sync, sync_folder = Entry(4, 7, 0, 0, ("/root/a",), b""), Entry(5, 1, 0, 0, ("/root",), b"")
    rename = Entry(6, 0, 0, 0, ("/root/a", "/root/b"), b"")
    assert left(create, write, sync) == {}
    assert left(create, write, sync_folder) == {"a": b""}
    assert left(create, write, sync, sync_folder, more) == {"a": b"abc"}
    assert left(create, write, sync, sync_folder, rename) == {"a": b"abc"}
    assert left(create, write, sync, sync_folder, rename, sync_folder) == {"b": b"abc"}
