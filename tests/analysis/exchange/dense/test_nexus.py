"""NeXus files, read back by h5py and by nexusformat, the library of NeXpy."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

from analysis.exchange.dense import nexus
from analysis.exchange.exported import Export, one_line
from instrument.errors import InputError
from tests.support.exchange.fitted_models import explained_by, fitted
from tests.support.exchange.random_tables import KINDS, random_export, relative

h5py = pytest.importorskip("h5py", reason="the library of NeXus files is not installed")
nexpy = pytest.importorskip("nexusformat.nexus", reason="the library of NeXpy is not installed")

MODEL = fitted("oren_nayar", albedo=0.7, sigma_deg=20)


def _written(export: Export, folder: Path) -> Path:
    ((name, content),) = nexus.files(export, "mine")
    (folder / name).write_bytes(content)
    return folder / name


def _random(seed: int) -> Export:
    """Export of one of all kinds of tables, with and without a model and an absolute scale."""
    export = random_export(seed)
    export = replace(export, model=MODEL if seed // len(KINDS) % 2 else None)
    return relative(export) if seed % 3 == 0 else export


@pytest.mark.parametrize("seed", range(4 * len(KINDS)))
def test_every_value_is_read_back_as_measured(seed: int, tmp_path: Path) -> None:
    export = _random(seed)
    table = export.table
    with h5py.File(_written(export, tmp_path)) as file:
        points = file["entry/points"]
        assert np.array_equal(points["brdf"][()], table.brdf)
        for name in ("theta_i", "theta_r", "dphi"):
            assert np.array_equal(points[name][()], getattr(table.geometry, f"{name}_deg"))
        has_u = not np.all(np.isnan(table.u_brdf))
        assert ("brdf_errors" in points) == has_u
        if has_u:
            assert np.array_equal(points["brdf_errors"][()], table.u_brdf, equal_nan=True)
        assert points["brdf"].attrs["units"] == ("arbitrary" if table.relative else "1/sr")
        assert points["brdf"].attrs["origin"] == "measured"
        instrument = file["entry/instrument"]
        solid_angles = {"source": table.source_sr, "detector": table.receiver_sr}
        for part, solid_angle in solid_angles.items():
            stored = instrument[part].get("solid_angle")
            assert (None if stored is None else stored[()]) == solid_angle
        for name, text in export.facts.items():
            assert file["entry/facts"][name][()].decode() == one_line(text)
        if export.model is None:
            assert "modelled_brdf" not in points
            assert "model" not in file["entry"]


@pytest.mark.parametrize("seed", range(2 * len(KINDS)))
def test_nexpy_plots_the_default_with_axis_errors_and_the_models_curve(
    seed: int, tmp_path: Path
) -> None:
    """They follow default attributes to an NXdata with signal, axes and errors."""
    export = replace(_random(seed), model=MODEL)
    root = nexpy.nxload(str(_written(export, tmp_path)))
    shown = root.plottable_data
    assert isinstance(shown, nexpy.NXdata)
    assert shown.nxsignal.nxname == "brdf"
    assert np.atleast_1d(shown.attrs["auxiliary_signals"]).tolist() == ["modelled_brdf"]
    assert shown["modelled_brdf"].attrs["origin"] == "modelled"
    assert np.all(np.diff(np.atleast_1d(shown.nxaxes[0].nxvalue)) >= 0)
    assert shown.nxsignal.size == shown.nxaxes[0].size
    assert (shown.nxerrors is None) == bool(np.all(np.isnan(export.table.u_brdf)))


def test_a_sweep_has_the_signed_view_angle_as_axis(tmp_path: Path) -> None:
    export = random_export(KINDS.index("whole sweeps"))
    geometry = export.table.geometry
    with h5py.File(_written(export, tmp_path)) as file:
        sweeps = [group for name, group in file["entry"].items() if name.startswith("sweep")]
        assert len(sweeps) == len(set(geometry.theta_i_deg)) > 1
        assert sum(sweep["brdf"].size for sweep in sweeps) == export.table.size
        for sweep in sweeps:
            sign = np.where(sweep["dphi"][()] < 180, 1, -1)
            assert np.array_equal(sweep["theta_r_signed"][()], sign * sweep["theta_r"][()])
            assert len(set(sweep["theta_i"][()])) == 1
            assert set(sweep["theta_i"][()]) <= set(geometry.theta_i_deg)


def test_the_modelled_curve_is_that_of_the_model(tmp_path: Path) -> None:
    export = replace(random_export(KINDS.index("out of plane")), model=MODEL)
    with h5py.File(_written(export, tmp_path)) as file:
        expected = MODEL.brdf(export.table.geometry)
        assert np.array_equal(file["entry/points/modelled_brdf"][()], expected)
        parameters = file["entry/model"]
        assert parameters["albedo"][()] == 0.7
        assert parameters["sigma_deg"].attrs["units"] == "degrees"
        assert parameters["albedo_errors"][()] == 0.01
        assert np.isnan(parameters["sigma_deg_errors"][()])
        assert parameters["verdict"][()].decode() == "adequate"


def test_the_curve_of_relative_values_lies_at_their_level(tmp_path: Path) -> None:
    """Each incidence has a lamp level of its own; the curve says that only its shape counts."""
    export = relative(explained_by(MODEL, random_export(KINDS.index("whole sweeps"))))
    level = 100 + export.table.geometry.theta_i_deg
    table = replace(export.table, brdf=level * export.table.brdf)
    with h5py.File(_written(replace(export, table=table), tmp_path)) as file:
        curve = file["entry/points/modelled_brdf"]
        assert np.allclose(curve[()], table.brdf, rtol=1e-12)
        assert "the shape alone counts" in curve.attrs["note"]


def test_sample_and_times_stand_where_nexus_has_a_place_for_them(tmp_path: Path) -> None:
    facts = {"sample": "a\nplate", "measured_utc": "2026-11-20T10:00:00Z to 2026-11-20T10:30:00Z"}
    with h5py.File(_written(replace(random_export(0), facts=facts), tmp_path)) as file:
        entry = file["entry"]
        assert entry["start_time"][()].decode() == "2026-11-20T10:00:00Z"
        assert entry["end_time"][()].decode() == "2026-11-20T10:30:00Z"
        assert entry["title"][()] == entry["sample/name"][()] == b"a plate"


def test_without_the_library_the_command_says_what_to_install() -> None:
    with (
        patch.dict(sys.modules, {"h5py": None}),
        pytest.raises(InputError, match=r"gonio\[nexus\]"),
    ):
        list(nexus.files(random_export(0), "mine"))
