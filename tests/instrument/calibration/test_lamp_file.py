"""File of a lamp's calibration: read as written, and refused where it cannot be believed."""

from __future__ import annotations

import zipfile
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from instrument.calibration.lamp_file import (
    LampCalibration,
    LightMap,
    read_lamp_file,
    write_lamp_file,
)
from instrument.calibration.quantity import Quantity
from instrument.errors import InputError

OWN = LampCalibration(
    lamp="a lamp", camera="Maker M1", settings={"gain": "100"}, rig="bench",
    pose_deg={"theta_i": 30.0, "dphi": 0.0, "theta_r": 0.0}, date_utc="2026-11-27T20:00:00+00:00",
    program="gonio 0", steady=True,
    quantities={"steady_s": Quantity(value=1.5, u=0.1, unit="s", symbol="", name="steady after")},
    light_map=LightMap(
        exponents=((0, 0), (1, 0), (0, 1)), coefficients=(1.0, 0.1, -0.2), half_mm=22.5
    ),
    notes=("a note",), arrays={"readings": np.ones((5, 3)), "cells": np.zeros((7, 4))},
)  # fmt: skip


def test_a_calibration_is_read_as_it_was_written(tmp_path: Path) -> None:
    written = write_lamp_file(tmp_path / "l.npz", OWN)
    found = read_lamp_file(tmp_path / "l.npz")
    for field in fields(LampCalibration):
        if field.name != "arrays":
            assert getattr(found, field.name) == getattr(written, field.name), field.name
    assert all(np.array_equal(found.arrays[n], OWN.arrays[n]) for n in OWN.arrays)
    assert len(found.sha256) == 64


def test_damaged_and_foreign_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "l.npz"
    write_lamp_file(path, replace(OWN, arrays={"readings": np.ones((5, 2)), "cells": np.ones(3)}))
    with pytest.raises(InputError, match="the table readings has not 3 columns"):
        read_lamp_file(path)
    write_lamp_file(path, OWN)
    text = zipfile.ZipFile(path).read("calibration.json").replace(b"a lamp", b"a lump")
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("calibration.json", text)
    with pytest.raises(InputError, match="was changed or damaged"):
        read_lamp_file(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("calibration.json", '{"format": "gonio camera calibration", "version": 1}')
    with pytest.raises(InputError, match="allowed: 'gonio lamp calibration', version 1"):
        read_lamp_file(path)
