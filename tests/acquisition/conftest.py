"""A small scan, its record, and its readings without interruption."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from instrument.config.load import Loaded
from instrument.record.reading import Reading
from instrument.record.record import Record
from tests.support.scans import small_scan, undated
from tests.support.whole_scans.stopped_scan import scan


@pytest.fixture(scope="package")
def small() -> Loaded:
    """Two incidences, five view angles, all references; a camera with few pixels."""
    return small_scan()


@pytest.fixture(scope="package")
def whole(small: Loaded, tmp_path_factory: pytest.TempPathFactory) -> list[Reading]:
    """The readings of a scan that nothing interrupted."""
    with Record.create(tmp_path_factory.mktemp("whole") / "run", {}) as record:
        scan(small, record)
        return undated(record.readings())


@pytest.fixture
def record(tmp_path: Path) -> Iterator[Record]:
    with Record.create(tmp_path / "run", {}) as record:
        yield record
