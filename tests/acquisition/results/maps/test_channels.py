"""Maps by a colour camera: one sigma, an albedo in each channel, and the truth within u."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from acquisition.results.maps.sample_map import map_sample
from analysis.sample_maps.files import npz_bytes
from analysis.sample_maps.page import map_html
from analysis.sample_maps.pictures import screen_colours
from instrument.config.protocol import MapsConfig
from instrument.devices import CHANNELS
from instrument.errors import InputError
from instrument.record.record import Record
from tests.support.sample_maps.varied import Varied, truth
from tests.support.scans import changed
from tests.support.whole_scans.stopped_scan import scan

ONE, CELL_MM = (45.0,), 3.2
ALBEDOS = [f"albedo_{channel}" for channel in CHANNELS]
MORE = [
    Varied(pattern, incidences, tile=True, seed=300 + n, colour=True)
    for n, (pattern, incidences) in enumerate(
        4 * [(p, i) for p in ("halves", "gradient", "patch") for i in ((30.0, 60.0), ONE)]
    )
]


def test_each_channel_has_its_albedo_and_all_have_one_sigma(tmp_path: Path) -> None:
    """From kept frames, from cells gathered while scanning, and by one channel for comparison."""
    varied = Varied("halves", ONE, tile=True, seed=21, colour=True)
    both = changed(varied.loaded(), maps=MapsConfig(cell_mm=CELL_MM))
    frames, cells = changed(both, maps=None), changed(both, keep_frames=False)
    with Record.create(tmp_path / "run", {}) as record:
        scan(both, record)
        found = map_sample(record, frames, "oren_nayar", CELL_MM)
        gathered = map_sample(record, cells, "oren_nayar")
    mono, _ = Varied("halves", ONE, tile=True, seed=21).mapped(tmp_path / "mono", CELL_MM)
    assert list(found.values) == [*ALBEDOS, "sigma_deg"]
    true = truth(found, both)
    for own in (found, gathered):
        for name, values in own.values.items():
            off = np.abs(values - true[name]) / own.u(name)
            assert np.mean(off[np.isfinite(off)] < 1.96) > 0.85
            apart = np.abs(values - found.values[name]) / np.hypot(own.u(name), found.u(name))
            assert np.mean(apart[np.isfinite(apart)] < 1.96) > 0.9
    assert found.rejected[:, np.abs(found.x_mm) > CELL_MM].mean() < 0.02  # beside the edge: chance
    ratio = found.u_own["sigma_deg"] / mono.u_own["sigma_deg"]
    assert 0.5 < np.nanmedian(ratio) < 0.8  # three times the light, less what channels share
    assert b"u_albedo_b" in npz_bytes(found)
    assert found.colour is not None
    drawn = screen_colours(found.colour)
    fitted = found.fitted
    assert np.array_equal(drawn[..., 3], fitted)
    assert np.array_equal(
        np.argmax(drawn[fitted][:, :3], axis=-1), np.argmax(found.colour[fitted], axis=-1)
    )


def test_colours_on_a_screen_are_those_of_srgb() -> None:
    """Grey of 18 % is 118 of 255 (IEC 61966-2-1); more than white is white."""
    drawn = screen_colours(np.array([[[0.18, 0.18, 0.18], [1.3, 0.0, np.nan], [1.2, 0.0, 1.0]]]))
    assert np.rint(255 * drawn[0, 0, :3]).tolist() == [118, 118, 118]
    assert drawn[0, :, 3].tolist() == [1, 0, 1]
    assert drawn[0, 2, :3] == pytest.approx([1, 0, 1])


def test_without_what_tells_the_responses_there_is_one_channel_or_an_error(tmp_path: Path) -> None:
    loaded = Varied("halves", ONE, tile=True, seed=22, colour=True).loaded()
    with Record.create(tmp_path / "run", {}) as record:
        scan(loaded, record)
        step = next(r.step for r in record.readings() if r.kind == "tile")
        names = [name for name in record.frame_files() if int(name[7:13]) == step]
        path = record.folder / names[0]
        counts = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        counts[..., 0] = loaded.rig.camera.max_dn  # OpenCV has blue first
        cv2.imwrite(str(path), counts)
        with pytest.raises(InputError, match=rf"tile at step {step} shows no light in .* b: satur"):
            map_sample(record, loaded, "oren_nayar", CELL_MM)
        cv2.imwrite(str(path), counts[..., 1])
        with pytest.raises(InputError, match=r"allowed: a TIFF of \(\d+, \d+, 3\) and uint16"):
            map_sample(record, loaded, "oren_nayar", CELL_MM)
    bare = Varied("halves", ONE, tile=False, seed=22, colour=True)
    found, _ = bare.mapped(tmp_path / "bare", CELL_MM)
    assert list(found.values) == ["albedo", "sigma_deg"]
    assert found.colour is None
    assert any("the green channel is mapped" in note for note in found.notes)


@pytest.mark.slow
def test_the_truth_lies_within_u_in_about_95_percent_of_the_cells(
    tmp_path: Path, slow: bool, record_property: Callable[[str, object], None]
) -> None:
    if not slow:
        pytest.skip("24 scans take a minute: with --slow; one is tested above")
    inside: dict[str, list[np.ndarray]] = {name: [] for name in (*ALBEDOS, "sigma_deg")}
    rejected = []
    for number, varied in enumerate(MORE):
        found, loaded = varied.mapped(tmp_path / f"run {number}")
        true = truth(found, loaded)
        rejected.append(found.rejected_share)
        if not number:
            page = map_html(found)
            assert "Albedo in colour" in page
            assert "albedo, blue" in page
        for name, cells in inside.items():
            off = np.abs(found.values[name] - true[name]) / found.u(name)
            cells.append(off[np.isfinite(off)] < 1.96)
    shares = {name: float(np.mean(np.concatenate(cells))) for name, cells in inside.items()}
    for name, share in shares.items():
        record_property(f"share of cells with {name} within 1.96 u", share)
    record_property("share of rejected cells", float(np.mean(rejected)))
    assert 0.93 < shares["sigma_deg"] < 0.99
    # The error of a tile is that of all cells: of 24 tiles 22.8 are within 1.96 u.
    assert min(shares[name] for name in ALBEDOS) > 0.85
    assert np.mean(rejected) < 0.02
