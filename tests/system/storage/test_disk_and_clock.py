"""Full, read-only or locked files, a moved folder, a clock set back: nothing is lost."""

from __future__ import annotations

import csv
import logging
import shutil
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

import pytest

from acquisition.commands.scan_session import scan
from acquisition.engine.engine import Devices
from acquisition.engine.resume import Progress
from acquisition.plan.plan import make_plan
from acquisition.rig import open_devices
from instrument.clock import Clock
from instrument.errors import StorageError
from instrument.record import write_lock
from instrument.record.reading import Reading
from instrument.record.record import FILE_NAME, Record
from tests.support.command import gonio_here as gonio
from tests.support.ready.ready_process import ReadyProcess
from tests.support.scans import shortest_scan, small_demo, undated
from tests.support.storage.holder import Holder, held

LOADED = shortest_scan()
PLAN = make_plan(LOADED)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> list[Reading]:
    with Record.create(tmp_path_factory.mktemp("whole") / "run", {}) as record:
        scan(LOADED, PLAN, record)
        return undated(record.readings())


def at_step(
    monkeypatch: pytest.MonkeyPatch, step: int, happens: Callable[[Devices], Devices | None]
) -> None:
    """Call `happens` when the scan begins that step."""

    def opening(loaded: object) -> Devices:
        devices = open_devices(LOADED)

        def begin_step(number: int, scan_s: float) -> None:
            if number == step:
                happens(devices)
            devices.begin_step(number, scan_s)

        return replace(devices, begin_step=begin_step)

    monkeypatch.setattr("acquisition.commands.scan_session.open_devices", opening)


def test_a_run_folder_that_is_moved_ends_the_scan_with_its_new_name(
    whole: list[Reading], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old, new = tmp_path / "run", tmp_path / "elsewhere"
    at_step(monkeypatch, 5, lambda _: old.rename(new) and None)
    with Record.create(old, {}) as record:
        with pytest.raises(StorageError) as failed:
            scan(LOADED, PLAN, record)
        accepted = len(record.readings())
    assert "was moved while the scan ran: nothing accepted is lost" in str(failed.value)
    assert f"gonio resume {new}" in str(failed.value)
    assert accepted == 4  # the point before waited to be written
    monkeypatch.undo()
    with Record.open(new) as record:
        scan(LOADED, PLAN, record, Progress(tuple(record.readings())))
        assert undated(record.readings()) == whole


def test_a_removed_run_folder_is_reported_as_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    at_step(monkeypatch, 5, lambda _: shutil.rmtree(tmp_path / "run"))
    with (
        Record.create(tmp_path / "run", {}) as record,
        pytest.raises(StorageError, match="was removed while the scan ran, and the") as failed,
    ):
        scan(LOADED, PLAN, record)
    assert "gonio resume" not in str(failed.value)  # there is nothing to resume


def test_a_clock_that_is_set_back_changes_the_dates_and_nothing_else(
    whole: list[Reading], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class SetBack:
        """Clock whose date can be set back; its monotonic time is not affected."""

        def __init__(self, clock: Clock) -> None:
            self._clock, self.back = clock, timedelta()

        def utc(self) -> datetime:
            return self._clock.utc() - self.back

        def __getattr__(self, name: str) -> object:
            return getattr(self._clock, name)

    def opening(loaded: object) -> Devices:
        devices = open_devices(LOADED)
        clock = SetBack(devices.clock)

        def begin_step(number: int, scan_s: float) -> None:
            clock.back = timedelta(hours=number >= 6)
            devices.begin_step(number, scan_s)

        return replace(devices, clock=clock, begin_step=begin_step)  # type: ignore[arg-type]  # a stand-in

    monkeypatch.setattr("acquisition.commands.scan_session.open_devices", opening)
    with Record.create(tmp_path / "run", {}) as record:
        scan(LOADED, PLAN, record)
        dates = [r.time_utc for r in record.readings()]
        assert dates != sorted(dates)
        assert undated(record.readings()) == whole


def test_a_record_that_another_program_holds_is_waited_for_and_named(
    whole: list[Reading],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    """The program lets go once the operator has been told."""
    monkeypatch.setattr(write_lock, "NOTICE_S", 0.0)
    file = tmp_path / "run" / FILE_NAME
    with ExitStack() as opened:
        holders: list[Holder] = []
        at_step(monkeypatch, 4, lambda _: holders.append(opened.enter_context(held(file))))
        released = logging.Handler(logging.WARNING)
        monkeypatch.setattr(released, "emit", lambda _: holders[0].release())
        monkeypatch.setattr(write_lock.log, "handlers", [released])
        with Record.create(tmp_path / "run", {}) as record:
            scan(LOADED, PLAN, record)
            assert undated(record.readings()) == whole
            retries = [text for _, kind, text in record.events() if kind == "retry"]
    assert retries
    assert f"process {holders[0].pid} (" in retries[0]
    assert retries[0] in capfd.readouterr().err.replace("\n", "")


# The whole command, on a disk with a quota.


@pytest.fixture(scope="module")
def protocol(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The small demonstration with fewer angles, the sample's model and kept frames."""
    path = small_demo(tmp_path_factory.mktemp("protocol"), "oren_nayar+torrance_sparrow")
    text = path.read_text().replace("num: 9", "num: 5")
    text = text.replace("frames_per_point: 4", "frames_per_point: 2")
    path.write_text(f"{text}keep_frames: true\n")
    return path


@pytest.fixture(scope="module")
def disk(recorder: dict[str, str]) -> Iterator[ReadyProcess]:
    """The command on a disk that may be in trouble: see `write_recorder.c`."""
    with ReadyProcess(environment=recorder) as ready:
        yield ready


@pytest.fixture(scope="module")
def finished(protocol: Path, tmp_path_factory: pytest.TempPathFactory) -> list[list[str]]:
    """measurements.csv of a run on a disk with enough room."""
    folder = tmp_path_factory.mktemp("finished") / "run"
    done = gonio("run", protocol, "--out", folder)
    assert done.returncode == 0, done.stderr
    return table(folder)


def table(run: Path) -> list[list[str]]:
    """Return measurements.csv without the dates."""
    with (run / "measurements.csv").open(newline="") as file:
        rows = list(csv.reader(file))
    dated = rows[0].index("time_utc")
    return [row[:dated] + row[dated + 1 :] for row in rows]


# Bytes written: the next belong to a frame, or to the record.
@pytest.mark.parametrize("quota", [1_000_000, 750_000])
def test_a_full_disk_ends_the_scan_which_resumes_with_more_room(
    quota: int,
    protocol: Path,
    finished: list[list[str]],
    disk: ReadyProcess,
    tmp_path: Path,
) -> None:
    run = tmp_path / "disk" / "run"
    trouble = {"GONIO_RECORD_ROOT": str(run.parent), "GONIO_RECORD_QUOTA": str(quota)}
    done = disk.run("run", protocol, "--out", run, **trouble)
    assert done.returncode == 3, done.stderr
    assert "the disk is full" in done.stderr
    assert "make room on it" in done.stderr
    assert f"gonio resume {run}" in done.stderr
    assert "Traceback" not in done.stderr
    assert not (run / "measurements.csv").exists()
    with Record.open(run) as record:
        assert all((run / name).stat().st_size > 0 for name in record.frame_files())
        assert not list(run.glob("**/.*.part"))
    resumed = gonio("resume", run, "--yes")
    assert resumed.returncode == 0, resumed.stderr
    assert table(run) == finished


def test_a_disk_that_is_full_at_the_start_leaves_no_folder(
    protocol: Path, disk: ReadyProcess, tmp_path: Path
) -> None:
    run = tmp_path / "disk" / "run"
    trouble = {"GONIO_RECORD_ROOT": str(run.parent), "GONIO_RECORD_QUOTA": "20000"}
    done = disk.run("run", protocol, "--out", run, **trouble)
    assert done.returncode == 2, done.stderr
    assert f"{run}: no run can be written there: the disk is full" in done.stderr
    assert not run.exists()


def test_a_read_only_folder_is_named_and_left_unchanged(
    protocol: Path, disk: ReadyProcess, tmp_path: Path
) -> None:
    folder = tmp_path / "disk"
    with Record.create(folder / "run", {}):
        pass
    trouble = {"GONIO_RECORD_ROOT": str(folder), "GONIO_RECORD_READ_ONLY": "1"}
    done = disk.run("run", protocol, "--out", folder / "new", **trouble)
    assert done.returncode == 2, done.stderr
    assert "look at the folder's permissions" in done.stderr
    for command in ("resume", "report"):
        done = disk.run(command, folder / "run", **trouble)
        assert done.returncode == 3, done.stderr
        assert "cannot be written" in done.stderr
        assert "look at the folder's permissions" in done.stderr
        assert "Traceback" not in done.stderr
