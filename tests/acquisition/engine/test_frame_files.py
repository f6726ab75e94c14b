"""Kept frames: whole, named in the record, and refused beforehand if the disk is too small."""

from __future__ import annotations

import shutil
from pathlib import Path

import cv2
import pytest

from acquisition.engine.frame_files import (
    cell_bytes,
    frame_bytes,
    require_disk_space,
    require_own_folder,
)
from acquisition.measure.rectify.kept_files import dark_name, step_of
from acquisition.plan.plan import make_plan
from instrument.config.protocol import MapsConfig
from instrument.errors import InputError, StorageError
from instrument.record.record import Record
from tests.support.scans import changed, small_scan
from tests.support.whole_scans.stopped_scan import scan

LOADED = changed(small_scan(), keep_frames=True)


def test_frames_that_would_not_fit_are_refused_before_anything_moves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = make_plan(LOADED)
    needed = frame_bytes(plan, LOADED)
    camera = LOADED.rig.camera
    frames = sum(step.frames for step in plan.steps)
    assert needed == 2 * camera.width_px * camera.height_px * frames
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=needed - 1))
    with pytest.raises(InputError, match=r"keep_frames: the frames need .* GB, and .* GB free"):
        require_disk_space(plan, LOADED, tmp_path / "not yet" / "run")


def test_cells_that_no_camera_resolves_or_disk_holds_are_refused_beforehand(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    loaded = changed(small_scan(), maps=MapsConfig(cell_mm=1.0))
    plan = make_plan(loaded)
    needed = cell_bytes(plan, loaded)
    assert needed == 4 * 50 * 50 * 10
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=needed - 1))
    with pytest.raises(InputError, match=r"maps: the cells need .* GB, and .* GB free"):
        require_disk_space(plan, loaded, tmp_path / "run")
    fine = changed(loaded, maps=MapsConfig(cell_mm=0.1))
    with pytest.raises(InputError, match=r"demo.yaml: maps: cell_mm: 0.1 mm; allowed: 0.5625"):
        require_disk_space(plan, fine, tmp_path / "run")
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "cells").symlink_to(tmp_path)
    with pytest.raises(InputError, match="cells: is a link or no folder"):
        require_own_folder(loaded, tmp_path / "run")


def test_kept_frames_are_whole_and_named_in_the_record(tmp_path: Path) -> None:
    with Record.create(tmp_path / "run", {}) as record:
        scan(LOADED, record, upto=2)
        scan(LOADED, record, upto=4)
        files = record.frame_files()
        readings = record.readings()
    assert len(files) == sum(r.frames for r in readings)
    kept = {f"frames/{path.name}" for path in (tmp_path / "run/frames").iterdir()}
    darks = {dark_name(reading.exposure_s) for reading in readings}
    assert kept == {*files, *darks}
    assert [step_of(name) for name in files] == [r.step for r in readings for _ in range(r.frames)]
    for name in darks:
        dark = cv2.imread(str(tmp_path / "run" / name), cv2.IMREAD_UNCHANGED)
        assert dark.dtype == "float32"
        assert dark.mean() == pytest.approx(LOADED.rig.camera.black_level_dn, abs=2)
    image = cv2.imread(str(tmp_path / "run" / files[0]), cv2.IMREAD_UNCHANGED)
    assert image.shape == (LOADED.rig.camera.height_px, LOADED.rig.camera.width_px)
    assert image.dtype == "uint16"
    assert image.max() >= readings[0].peak_dn


def test_frames_are_never_written_through_a_link(tmp_path: Path) -> None:
    """In a run from elsewhere it could lead anywhere; a link to a file too."""
    (tmp_path / "outside").mkdir()
    with Record.create(tmp_path / "run", {}) as record:
        (tmp_path / "run" / "frames").symlink_to(tmp_path / "outside")
        with pytest.raises(InputError, match="frames: is a link or no folder; allowed: a folder"):
            require_own_folder(LOADED, record.folder)
        with pytest.raises(StorageError, match=r"frames.*cannot be written"):
            scan(LOADED, record)
        assert record.readings() == []
        (tmp_path / "run" / "frames").unlink()
        scan(LOADED, record, upto=1)
        require_own_folder(LOADED, record.folder)
    assert list((tmp_path / "outside").iterdir()) == []
