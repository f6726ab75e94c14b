"""MERL files as measurements: interpolated between the cells, or refused."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from analysis.exchange.dense import merl
from analysis.exchange.dense.merl_reader import (
    half_angles_deg,
    is_merl,
    read_merl,
    selected_geometries,
)
from instrument.errors import InputError
from instrument.geometry import Geometry
from tests.support.exchange.fitted_models import explained_by, fitted
from tests.support.exchange.random_tables import KINDS, random_export

SWEEPS = random_export(KINDS.index("whole sweeps"))


@cache
def content(name: str) -> bytes:
    return next(iter(merl.files(explained_by(fitted(name), SWEEPS), "mine")))[1]


def written(folder: Path, data: bytes) -> Path:
    path = folder / "mine.binary"
    path.write_bytes(data)
    return path


def test_angles_of_the_grid_are_those_of_its_cells() -> None:
    """Inverse of the directions that the export works from."""
    half, difference, phi = np.random.default_rng(2).uniform(0.01, 1.0, (3, 500))
    phi = np.pi * phi
    to_lamp, to_camera = merl.directions(half, difference, phi)
    above = np.minimum(to_lamp[:, 2], to_camera[:, 2]) > 0
    geometry = Geometry.from_directions(to_lamp[above], to_camera[above])
    found = half_angles_deg(geometry)
    for angle, expected in zip(found, (half, difference, phi), strict=True):
        assert angle == pytest.approx(np.degrees(expected[above]), abs=1e-5)


@pytest.mark.parametrize(("name", "most"), [("lambert", 1e-12), ("torrance_sparrow", 0.02)])
def test_a_file_of_a_model_gives_its_values(tmp_path: Path, name: str, most: float) -> None:
    """To within the interpolation between cells."""
    table = read_merl(written(tmp_path, content(name)))
    m = table.measurements
    geometry = Geometry(m.theta_i_deg, m.theta_r_deg, m.dphi_deg)
    off = np.abs(m.brdf / fitted(name).brdf(geometry) - 1)
    assert np.max(off) < most
    assert table.alike
    assert m.u_random is None
    assert m.size + table.without == selected_geometries().theta_i_deg.size
    assert m.size > 200


def test_colours_are_taken_together_as_luminance(tmp_path: Path) -> None:
    """White is the sum of the weights, which is 1; green alone counts for 72 %."""
    data = bytearray(content("lambert"))
    plane = 8 * int(np.prod(merl.SHAPE))
    for colour in (0, 2):
        begin = 12 + colour * plane
        values = np.frombuffer(bytes(data[begin : begin + plane]), dtype="<f8")
        data[begin : begin + plane] = np.where(values > 0, 0.0, values).tobytes()
    table = read_merl(written(tmp_path, bytes(data)))
    m = table.measurements
    white = fitted("lambert").brdf(Geometry(m.theta_i_deg, m.theta_r_deg, m.dphi_deg))
    assert m.brdf == pytest.approx(0.7152 * white)
    assert not table.alike


def test_geometries_beside_a_cell_without_value_are_left_out(tmp_path: Path) -> None:
    data = bytearray(content("lambert"))
    values = np.frombuffer(bytes(data[12:]), dtype="<f8").reshape(3, *merl.SHAPE).copy()
    values[:, :30] = -1.0  # small half-angles: about the mirror direction
    data[12:] = values.tobytes()
    m = read_merl(written(tmp_path, bytes(data))).measurements
    half, _, _ = half_angles_deg(Geometry(m.theta_i_deg, m.theta_r_deg, m.dphi_deg))
    assert np.min(half) >= 30**2 / 90
    assert m.size < read_merl(written(tmp_path, content("lambert"))).measurements.size


def test_other_files_are_refused(tmp_path: Path) -> None:
    whole = content("lambert")
    nan = np.array([np.nan]).tobytes()
    for data, why in (
        (whole[:-8], "34992004 bytes; a MERL file has 34992012"),
        (whole + b"\0", "34992013 bytes"),
        (whole[:12], "12 bytes"),
        (whole[:20] + nan + whole[28:], "1 values are no finite numbers"),
        (whole[:12] + np.full((len(whole) - 12) // 8, -1.0).tobytes(), "has no value at any"),
    ):
        with pytest.raises(InputError, match=why):
            read_merl(written(tmp_path, data))
    assert not is_merl(written(tmp_path, b"theta_i_deg,brdf\n"))
    assert not is_merl(tmp_path)
    assert not is_merl(tmp_path / "absent")
