"""Kept pictures: those that the record names and the run holds, whoever made the record."""

from __future__ import annotations

import os
import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import cv2
import numpy as np
import pytest

from acquisition.live.following.run_reader import RunReader
from acquisition.live.web.pictures import kept_picture
from instrument.record.record import FILE_NAME
from tests.support.live.runs import live_protocol, whole_run
from tests.support.storage.older_records import seal_again

STEP = 6  # a point of which the record itself holds no picture


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("kept")
    return whole_run(live_protocol(folder, keep_frames=True), folder / "run")


@pytest.fixture
def run(made: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(made, tmp_path / "run"))


@pytest.fixture
def reader(run: Path) -> Iterator[RunReader]:
    with RunReader(run) as one:
        yield one


def first_frame(run: Path, step: int) -> Path:
    return run / "frames" / f"{step:06d}-0000.tiff"


def decoded(data: bytes | None) -> np.ndarray:
    assert data is not None
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)


def test_a_kept_frame_is_grey_and_its_saturated_pixels_are_red(
    run: Path, reader: RunReader
) -> None:
    image = cv2.imread(str(first_frame(run, STEP)), cv2.IMREAD_UNCHANGED)
    image[20:30, 40:60] = reader.loaded.rig.camera.max_dn
    cv2.imwrite(str(first_frame(run, STEP)), image)
    shown = decoded(kept_picture(reader, STEP)).astype(int)
    assert shown.shape[:2] == image.shape
    blue, _, red = (shown[..., n] for n in range(3))
    found = np.argwhere(red - blue > 100)
    assert found.min(axis=0).tolist() == pytest.approx([20, 40], abs=2)
    assert found.max(axis=0).tolist() == pytest.approx([29, 59], abs=2)


def test_without_a_kept_frame_it_is_the_picture_of_the_record_or_none(tmp_path: Path) -> None:
    run = whole_run(live_protocol(tmp_path), tmp_path / "run")
    with RunReader(run) as reader, closing(sqlite3.connect(run / FILE_NAME)) as database:
        (step,) = database.execute("SELECT step FROM preview LIMIT 1").fetchone()
        assert decoded(kept_picture(reader, step)).shape[:2] == (51, 64)
        assert kept_picture(reader, 0) is None
        assert kept_picture(reader, 10**9) is None


def test_a_frame_that_is_missing_or_no_picture_gives_none(run: Path, reader: RunReader) -> None:
    for content in (b"", b"II*\0 but no TIFF", os.urandom(2000)):
        first_frame(run, STEP).write_bytes(content)
        assert kept_picture(reader, STEP) is None
    first_frame(run, STEP).unlink()
    assert kept_picture(reader, STEP) is None


NAMES = ("../secret.tiff", "/etc/passwd", "frames/../../secret.tiff", "frames/000005-0000.tiff",
         "frames/000006-0000.tiff/", "frames//000006-0000.tiff", "secret.tiff",
         "frames/000006-0000.tiff.tiff")  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_a_record_from_elsewhere_names_no_other_file(run: Path, name: str) -> None:
    """Neither one outside the run nor the frame of another step."""
    frame = first_frame(run, STEP).read_bytes()
    first_frame(run, STEP).unlink()
    for place in (run.parent / "secret.tiff", run / "secret.tiff"):
        place.write_bytes(frame)
    with closing(sqlite3.connect(run / FILE_NAME)) as database:
        database.execute("UPDATE frame SET file = ? WHERE step = ?", (name, STEP))
        seal_again(database)
        database.commit()
    with RunReader(run) as reader:
        assert kept_picture(reader, STEP) is None


@pytest.mark.parametrize("what", ["file", "folder", "pipe"])
def test_links_and_pipes_are_not_followed(run: Path, reader: RunReader, what: str) -> None:
    frame, elsewhere = first_frame(run, STEP), run.parent / "elsewhere"
    if what == "folder":
        frame.parent.rename(elsewhere)
        frame.parent.symlink_to(elsewhere)
    else:
        frame.rename(elsewhere)
        frame.symlink_to(elsewhere) if what == "file" else os.mkfifo(frame)
    assert kept_picture(reader, STEP) is None
