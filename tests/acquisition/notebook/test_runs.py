"""A loaded run holds what its files hold, and says what is wrong with it."""

from __future__ import annotations

import csv
import json
import shutil
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from acquisition.notebook.runs import Run, load
from instrument.errors import InputError, NoMeasurement
from instrument.record.record import Record

COLUMNS = {
    "theta_i_deg": "theta_i_deg",
    "theta_r_deg": "theta_r_deg",
    "dphi_deg": "dphi_deg",
    "brdf": "brdf_per_sr",
    "u_brdf": "u_brdf_per_sr",
    "radiance": "radiance_dn_per_s",
    "u_radiance": "u_radiance_dn_per_s",
}


def _rows(run: Run) -> list[dict[str, str]]:
    with (run.folder / "measurements.csv").open() as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("column", COLUMNS)
def test_an_array_is_the_table_s_column_digit_for_digit(scanned: Run, column: str) -> None:
    values = getattr(scanned, COLUMNS[column])
    assert values.shape == (len(scanned.flags),)
    assert values.tolist() == [float(row[column]) for row in _rows(scanned)]


def test_flags_and_parts_of_u_are_the_table_s(scanned: Run) -> None:
    rows = _rows(scanned)
    assert list(scanned.flags) == [row["flags"] for row in rows]
    for name, part in scanned.u_parts_relative.items():
        written = [float(row[f"u_{name.replace(' ', '_')}_relative"]) for row in rows]
        assert part.tolist() == written


def test_the_parts_of_u_make_up_the_whole(scanned: Run) -> None:
    parts = np.sqrt(sum(u**2 for u in scanned.u_parts_relative.values()))
    # The fit's covariance is that of a curve near its own.
    assert parts * scanned.brdf_per_sr == pytest.approx(scanned.u_brdf_per_sr, rel=0.02)
    assert {error.name for error in scanned.shared} <= set(scanned.u_parts_relative)


def test_the_run_s_own_fit_is_that_of_its_report(scanned: Run) -> None:
    written = json.loads((scanned.folder / "fit.json").read_text())
    fit = scanned.fit()
    assert (fit.best.model if fit.best else None, fit.verdict) == (
        written["chosen"],
        written["verdict"],
    )
    assert fit.to_json() == written


def test_named_models_are_the_only_candidates(scanned: Run) -> None:
    fit = scanned.fit(["lambert", "minnaert"])
    assert {c.model for c in fit.candidates} == {"lambert", "minnaert"}
    assert fit.verdict == "none adequate"
    assert [c.bic for c in fit.candidates] == sorted(c.bic for c in fit.candidates)


def test_the_plot_names_its_axes_with_units_and_shows_every_incidence(scanned: Run) -> None:
    figure = scanned.plot()
    shown = [ax for ax in figure.axes if ax.get_visible()]
    assert len(shown) == len(set(scanned.theta_i_deg))
    assert shown[0].get_ylabel() == "BRDF (1/sr)"
    assert "(°)" in shown[0].get_xlabel()
    assert figure._repr_png_().startswith(b"\x89PNG")  # type: ignore[attr-defined]  # as Jupyter


def test_the_data_frame_has_a_column_for_each_array(
    scanned: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    """pandas takes a mapping of columns; here a stand-in gives it back."""
    monkeypatch.setitem(sys.modules, "pandas", SimpleNamespace(DataFrame=dict))  # type: ignore[arg-type]  # a stand-in for the module
    frame = scanned.to_pandas()
    assert set(COLUMNS.values()) | {"flags"} == set(frame)
    assert {len(column) for column in frame.values()} == {len(scanned.flags)}


def test_without_pandas_the_error_says_how_to_get_it(
    scanned: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)  # type: ignore[arg-type]  # cannot be imported
    with pytest.raises(ImportError, match="pip install pandas"):
        scanned.to_pandas()


def test_one_line_says_what_a_run_is(scanned: Run) -> None:
    assert repr(scanned) == (
        f"<run 'demo': {len(scanned.flags)} points; the run is complete: all readings are recorded "
        "and reported>"
    )


def test_a_stopped_run_loads_with_what_it_has(scanned: Run, tmp_path: Path) -> None:
    folder = tmp_path / "stopped"
    shutil.copytree(scanned.folder, folder)
    whole = scanned.reduced.points
    with Record.open(folder) as record:
        record._db.execute("DELETE FROM reading WHERE step > 8")  # as after a stop at step 8
        record._db.commit()
    stopped = load(folder)
    kept = [p.step for p in whole if p.step <= 8]
    assert len(stopped.flags) == len(kept) > 0
    assert "gonio resume" in stopped.state


def test_a_run_without_a_point_has_nothing_to_draw_or_to_fit(scanned: Run, tmp_path: Path) -> None:
    folder = tmp_path / "begun"
    shutil.copytree(scanned.folder, folder)
    with Record.open(folder) as record:
        record._db.execute("DELETE FROM reading")
        record._db.commit()
    begun = load(folder)
    assert begun.brdf_per_sr.shape == (0,)
    for action in (begun.fit, begun.plot):
        with pytest.raises(NoMeasurement):
            action()


def test_what_is_no_run_is_refused_by_its_path(tmp_path: Path, scanned: Run) -> None:
    for wrong in (tmp_path, tmp_path / "absent", scanned.folder / "measurements.csv"):
        with pytest.raises(InputError, match=wrong.name):
            load(wrong)


def test_a_protocol_that_was_changed_since_is_refused(scanned: Run, tmp_path: Path) -> None:
    folder = tmp_path / "changed"
    shutil.copytree(scanned.folder, folder)
    protocol = folder / "protocol.yaml"
    protocol.write_text(protocol.read_text() + "\n# later\n")
    with pytest.raises(InputError, match="changed since the run began"):
        load(folder)
