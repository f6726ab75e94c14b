"""File of a geometry's calibration: what was written is read, and what was changed is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from instrument.calibration.geometry_file import (
    geometry_text,
    is_geometry_file,
    read_geometry_file,
    read_geometry_text,
    write_geometry_file,
)
from instrument.errors import InputError
from tests.support.calibration.geometry_files import FOUND


def test_a_calibration_and_the_copy_of_a_run_are_read_as_written(tmp_path: Path) -> None:
    path = tmp_path / "geometry.npz"
    written = write_geometry_file(path, FOUND)
    again = read_geometry_file(path)
    assert is_geometry_file(path)
    assert len(written.sha256) == 64
    assert np.array_equal(again.arrays["corners"], FOUND.arrays["corners"])
    assert replace(again, arrays={}) == replace(written, arrays={})
    copy = tmp_path / "copy.json"
    copy.write_text(geometry_text(written))
    assert read_geometry_text(copy) == replace(written, arrays={})


def test_what_is_no_whole_calibration_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "geometry.npz"
    write_geometry_file(path, replace(FOUND, arrays={"corners": np.zeros((2, 3))}))
    with pytest.raises(InputError, match="lacks what a calibration needs"):
        read_geometry_file(path)
    write_geometry_file(path, replace(FOUND, roll_deg=float("nan")))
    with pytest.raises(InputError, match="a value is not finite"):
        read_geometry_file(path)
    write_geometry_file(path, FOUND)
    raw = bytearray(path.read_bytes())
    raw[len(raw) // 2] ^= 1
    path.write_bytes(raw)
    with pytest.raises(InputError, match=r"geometry.npz: (is no|was changed)"):
        read_geometry_file(path)
    copy = tmp_path / "copy.json"
    lacking = json.loads(geometry_text(FOUND))
    del lacking["zero_deg"]
    for text in ("[]", "{", json.dumps(lacking)):
        copy.write_text(text)
        with pytest.raises(InputError, match=r"copy.json: (is no copy|lacks)"):
            read_geometry_text(copy)
