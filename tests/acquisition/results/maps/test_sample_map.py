"""Maps of simulated samples that vary: the truth of each cell, within its u."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from acquisition.results.maps.sample_map import map_sample
from analysis.sample_maps.sample_map import SampleMap
from instrument.config.protocol import MapsConfig, Markers, Steps
from instrument.config.simulated.defects import LensDefects
from instrument.config.uncertainty.rig_lines import RigLines
from instrument.errors import InputError, NotDetermined
from instrument.record.record import Record
from tests.support.plates import with_plate
from tests.support.sample_maps.varied import Varied, truth
from tests.support.scans import changed, shortest_scan
from tests.support.whole_scans.stopped_scan import scan

BOTH, ONE = (30.0, 60.0), (45.0,)
QUICK = [
    Varied("halves", BOTH, True, 1),
    Varied("gradient", ONE, True, 2),
    Varied("patch", ONE, False, 3),
]
KINDS = [
    (pattern, incidences, tile)
    for pattern in ("halves", "gradient", "patch")
    for incidences, tile in ((BOTH, True), (ONE, True), (ONE, False))
]
MORE = [Varied(*kind, seed=100 + n) for n, kind in enumerate(4 * KINDS)]  # a tile for each


def _inside(found: SampleMap, true: dict[str, np.ndarray], name: str) -> np.ndarray:
    """True for each cell of one place that has the truth within 1.96 u."""
    off = np.abs(found.values[name] - true[name]) / found.u(name)
    known = np.isfinite(off)
    assert known.any()
    return np.asarray(off[known] < 1.96)


@pytest.mark.parametrize("varied", QUICK, ids=lambda v: v.pattern)
def test_the_truth_of_a_cell_lies_within_its_u(varied: Varied, tmp_path: Path) -> None:
    found, loaded = varied.mapped(tmp_path / "run", 4.0)  # few cells: each has angles of its own
    true = truth(found, loaded)
    assert _inside(found, true, "sigma_deg").mean() > 0.85
    if varied.tile:  # its own error is that of all cells; without, light of two bounces is unknown
        apart = np.nanmedian(np.abs(found.values["sigma_deg"] - true["sigma_deg"]))
        assert apart < 0.3
        assert np.nanmedian(np.abs(found.values["albedo"] / true["albedo"] - 1)) < 0.015
    assert found.relative != varied.tile
    assert not found.uniform
    assert "albedo and sigma_deg" in found.headline()
    # An edge is texture enough to tell the height; a gradient is not.
    if varied.pattern == "gradient":
        assert np.isinf(found.height_mm[1])
    else:
        assert found.height_mm[0] == pytest.approx(0.15, abs=0.01)
    assert found.rejected_share < 0.03  # cells on an edge, and chance


@pytest.mark.slow
def test_the_truth_lies_within_u_in_about_95_percent_of_the_cells(
    tmp_path: Path, slow: bool
) -> None:
    if not slow:
        pytest.skip("36 scans take a minute: with --slow; one of each pattern is tested above")
    inside: dict[str, list[np.ndarray]] = {"albedo": [], "sigma_deg": []}
    rejected = []
    for number, varied in enumerate(MORE):
        found, loaded = varied.mapped(tmp_path / f"run {number}")
        true = truth(found, loaded)
        rejected.append(found.rejected_share)
        for name, cells in inside.items():
            if varied.tile or name != "albedo":
                cells.append(_inside(found, true, name))
    assert 0.94 < np.mean(np.concatenate(inside["sigma_deg"])) < 0.99
    # The error of a tile is that of all cells: of 24 tiles 22.8 are within 1.96 u.
    assert np.mean(np.concatenate(inside["albedo"])) > 0.85
    assert np.mean(rejected) < 0.005  # 0.1 % by chance, and cells on an edge


def test_an_even_sample_is_uniform_and_its_model_holds(tmp_path: Path) -> None:
    loaded = Varied("halves", ONE, True, 5).loaded()
    sample = loaded.protocol.simulated_sample
    assert sample is not None
    dark_corners = LensDefects(vignetting=0.05)
    simulation = loaded.rig.simulation.model_copy(update={"lens_defects": dark_corners})
    even = changed(
        loaded,
        rig={"simulation": simulation, "uncertainty": RigLines(vignetting=0.05)},
        simulated_sample=sample.model_copy(update={"variation": None}),
    )
    with Record.create(tmp_path / "run", {}) as record:
        scan(even, record)
        found = map_sample(record, even, "oren_nayar", 4.0)
        unknown = changed(even, rig={"uncertainty": RigLines(u_vignetting=0.05)})
        vague = map_sample(record, unknown, "oren_nayar", 4.0)
    assert found.uniform
    # Vignetting that is not known is taken for albedo, by as much as its u says.
    assert not vague.uniform
    off = np.abs(vague.values["albedo"] - found.values["albedo"]) / vague.u("albedo")
    assert np.nanmax(np.abs(vague.values["albedo"] / found.values["albedo"] - 1)) > 0.01
    assert np.mean(off[np.isfinite(off)] < 1.96) > 0.95
    assert found.rejected_share < 0.02
    spread = found.spread("sigma_deg")
    assert spread is not None
    assert spread.median == pytest.approx(sample.parameters["sigma_deg"], abs=0.3)
    assert np.isinf(found.height_mm[1])  # no texture shows it


def test_cells_follow_the_plate_where_its_markers_are_seen(tmp_path: Path) -> None:
    loaded = with_plate(Varied("halves", ONE, True, 8).loaded(shrink=2), 1.4, -1.1, 1.0, 0.15)
    (sweep,) = loaded.protocol.sweeps
    views = {"theta_r_deg": [-60.0, -35.0, -10.0, 15.0, 55.0]}
    some = changed(loaded, sweeps=[{**sweep, **views}], frames_per_point=1)
    gathering = changed(some, maps=MapsConfig(cell_mm=2.7))
    with Record.create(tmp_path / "run", {}) as record:
        scan(gathering, record)
        found = map_sample(record, some, "oren_nayar", 2.7)
        gathered = map_sample(record, changed(gathering, keep_frames=False), "oren_nayar", 2.7)
        blind = map_sample(record, changed(some, markers=None), "oren_nayar", 2.7)
        elsewhere = Markers(size_mm=6.0, centres_mm=[[0.0, 3.0], [9.0, 3.0]])
        with pytest.raises(NotDetermined, match="two or more markers must be seen"):
            map_sample(record, changed(some, markers=elsewhere), "oren_nayar", 2.7)
    true = truth(found, some)
    for cells in (found, gathered):
        assert _inside(cells, true, "sigma_deg").mean() > 0.85
        assert _inside(cells, true, "albedo").mean() > 0.85
    edge = np.abs(found.x_mm) < 5.0  # a plate that is turned, too, is seen by its edge
    apart = [
        np.nanmax(np.abs(m.values["albedo"] / true["albedo"] - 1)[:, edge]) for m in (found, blind)
    ]
    assert apart[0] < 0.02 < apart[1]


def test_a_scan_that_does_not_stop_is_mapped(tmp_path: Path) -> None:
    loaded = Varied("halves", ONE, True, 6).loaded()
    (sweep,) = loaded.protocol.sweeps
    views = {"theta_r_deg": Steps(start=-65.0, stop=65.0, num=9)}
    flown = changed(loaded, sweeps=[{**sweep, **views}], motion="fly", frames_per_point=1)
    with Record.create(tmp_path / "run", {}) as record:
        scan(flown, record)
        found = map_sample(record, flown, "oren_nayar", 4.0)
    assert found.height_mm[0] == pytest.approx(0.15, abs=0.04)
    assert _inside(found, truth(found, flown), "sigma_deg").mean() > 0.85
    assert found.rejected_share < 0.06  # the edge is a twentieth of the cells


def test_a_run_without_frames_or_with_wrong_ones_is_refused(tmp_path: Path) -> None:
    loaded = changed(shortest_scan(), keep_frames=True)
    with Record.create(tmp_path / "bare", {}) as record:
        bare = changed(loaded, keep_frames=False)
        scan(bare, record)
        with pytest.raises(InputError, match=r"bare: the frames of this run were not kept.*keep_f"):
            map_sample(record, bare, "oren_nayar", 3.0)
    with Record.create(tmp_path / "run", {}) as record:
        scan(loaded, record)
        with pytest.raises(InputError, match=r"cell_mm: 0.5 mm; allowed: 1.125 .* to 25.4 mm"):
            map_sample(record, loaded, "oren_nayar", 0.5)
        points = {r.step for r in record.readings() if r.kind == "point"}
        name = next(n for n in record.frame_files() if int(n[7:13]) in points)
        path = record.folder / name
        cv2.imwrite(str(path), np.zeros((4, 5), dtype=np.uint16))
        with pytest.raises(InputError, match=rf"{name}: \(4, 5\), uint16; allowed: a TIFF of"):
            map_sample(record, loaded, "oren_nayar", 3.0)
        path.write_bytes(b"no picture")
        with pytest.raises(InputError, match="no picture; allowed: a TIFF of"):
            map_sample(record, loaded, "oren_nayar", 3.0)
        path.unlink()
        with pytest.raises(InputError, match=rf"1 of 16 frames .* are missing: {name}: put them"):
            map_sample(record, loaded, "oren_nayar", 3.0)


def test_bands_and_cells_gathered_while_scanning_give_the_same_map(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    both = changed(Varied("halves", ONE, True, 7).loaded(), maps=MapsConfig(cell_mm=3.2))
    loaded, gathering = changed(both, maps=None), changed(both, keep_frames=False)
    with Record.create(tmp_path / "run", {}) as record:
        scan(both, record)
        whole = map_sample(record, loaded, "oren_nayar", 3.2)
        gathered = map_sample(record, gathering, "oren_nayar")
        with pytest.raises(InputError, match=r"cells of 3 mm asked for, but .* of 3.2 mm"):
            map_sample(record, gathering, "oren_nayar", 3.0)
        kept = sorted((record.folder / "cells").iterdir())
        kept[1].write_bytes(kept[1].read_bytes()[:-4])
        with pytest.raises(InputError, match=rf"{kept[1].name}: cannot be read"):
            map_sample(record, gathering, "oren_nayar")
        np.save(kept[1], np.zeros(5))
        with pytest.raises(InputError, match=r"\(5,\), float64; allowed: 226 32-bit floats"):
            map_sample(record, gathering, "oren_nayar")
        monkeypatch.setattr("acquisition.results.maps.sample_map._MOST_BYTES", 4 * 11 * 15 * 5)
        parts = map_sample(record, loaded, "oren_nayar", 3.2)
    assert parts.height_mm == pytest.approx(whole.height_mm)
    # Gathered cells were rectified for a surface on the axis: those on an edge are known worse.
    assert gathered.height_mm[0] == pytest.approx(0.15, abs=2 * gathered.height_mm[1])
    assert gathered.rejected_share < 0.03
    for name, values in whole.values.items():
        assert parts.values[name] == pytest.approx(values, rel=1e-5, nan_ok=True)
        off = np.abs(gathered.values[name] - values) / np.hypot(gathered.u(name), whole.u(name))
        assert np.mean(off[np.isfinite(off)] < 1.96) > 0.9
