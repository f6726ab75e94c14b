"""A table from Python holds the file's values, and the remarks that the command prints."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from acquisition.notebook.runs import Run
from acquisition.notebook.tables import read_table
from instrument.errors import InputError, NotDetermined


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("with_u", [True, False])
def test_values_come_as_they_stand_in_the_file(tmp_path: Path, seed: int, with_u: bool) -> None:
    rng = np.random.default_rng(seed)
    size = int(rng.integers(1, 30))
    columns = {
        "theta_i_deg": rng.uniform(0, 80, size),
        "theta_r_deg": rng.uniform(-80, 80, size),
        "dphi_deg": rng.uniform(0, 180, size),
        "brdf": rng.uniform(0.01, 1, size),
    }
    if with_u:
        columns["u_brdf"] = columns["brdf"] * rng.uniform(0.001, 0.1, size)
    path = tmp_path / "table.csv"
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    lines = [",".join(map(repr, row)) for row in rows]
    path.write_text("\n".join([",".join(columns), *lines]) + "\n")
    table = read_table(path)
    for name in ("theta_i_deg", "theta_r_deg", "dphi_deg"):
        assert getattr(table, name).tolist() == columns[name].tolist()
    assert table.brdf_per_sr.tolist() == columns["brdf"].tolist()
    u = table.u_independent_per_sr
    assert (None if u is None else u.tolist()) == (columns["u_brdf"].tolist() if with_u else None)
    assert any("assumed" in note for note in table.notes)
    assert repr(table) == f"<table of {size} geometries, BRDF in 1/sr>"


def test_the_table_of_a_run_fits_like_the_run(scanned: Run) -> None:
    table = read_table(scanned.folder / "measurements.csv")
    theirs, own = table.fit(["lambert"]), scanned.fit(["lambert"])
    assert theirs.parameters["albedo"] == pytest.approx(own.parameters["albedo"], rel=1e-9)
    assert table.plot().axes[0].get_ylabel() == "BRDF (1/sr)"


def test_a_data_frame_leaves_out_what_the_file_does_not_state(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "bare.csv"
    path.write_text("theta_i_deg,theta_r_deg,dphi_deg,brdf\n30,0,0,0.2\n30,10,0,0.2\n")
    monkeypatch.setitem(sys.modules, "pandas", SimpleNamespace(DataFrame=dict))  # type: ignore[arg-type]  # a stand-in for the module
    names = ["theta_i_deg", "theta_r_deg", "dphi_deg", "brdf_per_sr"]
    assert list(read_table(path).to_pandas()) == names


def test_oblique_rows_are_left_out_and_counted(tmp_path: Path) -> None:
    path = tmp_path / "oblique.csv"
    path.write_text("theta_i_deg,theta_r_deg,dphi_deg,brdf\n30,0,0,0.2\n30,70,0,0.2\n")
    table = read_table(path, max_theta_deg=60)
    assert table.theta_r_deg.tolist() == [0.0]
    assert any("1 of 2 points lie beyond 60 degrees" in note for note in table.notes)
    with pytest.raises(NotDetermined):
        read_table(path, max_theta_deg=20)


def test_a_wrong_file_is_named(tmp_path: Path) -> None:
    path = tmp_path / "wrong.csv"
    path.write_text("a,b\n1,2\n")
    with pytest.raises(InputError, match=r"wrong\.csv"):
        read_table(path)
