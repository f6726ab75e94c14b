"""The thread that writes: order, errors, waits that end, and one thread at a time."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

from instrument.errors import StorageError
from instrument.record.record import Record
from instrument.record.write_thread import WriteThread

PATH = Path("record.sqlite")


def test_the_error_of_a_write_is_raised_once_where_it_is_waited_for() -> None:
    writing = WriteThread(PATH)

    def fail() -> None:
        raise StorageError("the disk is full")

    writing.begin(fail)
    with pytest.raises(StorageError, match="full"):
        writing.wait()
    writing.wait()
    assert writing.end()


def test_a_write_begins_after_the_one_before_and_may_itself_write() -> None:
    writing, done = WriteThread(PATH), list[int]()
    for number in range(50):
        writing.begin(lambda number=number: writing.run(lambda: done.append(number)))
    writing.wait()
    assert done == list(range(50))


def test_a_write_that_hangs_is_given_up_and_named() -> None:
    writing, released = WriteThread(PATH), threading.Event()
    writing.begin(lambda: released.wait(60.0) and None)
    writing.give_up_within(0.01)
    with pytest.raises(StorageError, match=r"record\.sqlite: the last write has not ended"):
        writing.wait()
    assert not writing.end()
    released.set()


def test_a_record_whose_write_hangs_is_closed_without_waiting(tmp_path: Path) -> None:
    released = threading.Event()
    with Record.create(tmp_path / "run", {}) as record:
        record.add_event("2026", "operator", "before")
        record.writing.begin(lambda: released.wait(60.0) and None)
        record.writing.give_up_within(0.0)
        with pytest.raises(StorageError, match="has not ended"):
            record.readings()
    released.set()
    record.writing.give_up_within(60.0)
    record.close()


def test_what_is_written_in_the_background_is_there_when_the_record_is_read(
    tmp_path: Path,
) -> None:
    with Record.create(tmp_path / "run", {}) as record:
        for number in range(20):
            text = str(number)
            record.writing.begin(lambda text=text: record.add_event("2026", "operator", text))
            assert [text for *_, text in record.events()][-1] == text
