"""`gonio map`: the files that it writes, what it says, and what it refuses."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from tests.support.command import finished_run, gonio_here
from tests.support.scans import small_demo


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small run of the demonstration's foam with kept frames, fitted by one model."""
    folder = tmp_path_factory.mktemp("map")
    protocol = small_demo(folder, "oren_nayar")
    protocol.write_text(f"{protocol.read_text()}keep_frames: true\n")
    return finished_run(protocol, folder / "run")


@pytest.fixture
def plain_page(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages without charts, which take most of the time of a small map."""
    page = "acquisition.commands.outcomes.map.map_html"
    monkeypatch.setattr(page, lambda *_: "<html></html>")


def test_a_map_is_written_and_told(run: Path) -> None:
    done = gonio_here("map", run, "--cell-mm", 2, "--nexus")
    assert done.returncode == 0, done.stderr
    assert "25 × 25 cells of 2 mm" in done.stdout
    assert str(run / "map.nxs") in done.stdout
    page = (run / "map.html").read_text()
    assert "<svg" in page
    assert "25 × 25 cells of 2 mm" in page
    assert 'href="report.html"' in page
    assert (run / "report.html").read_text().count('href="map.html"') == 1
    with np.load(run / "map.npz") as maps:
        sigma, u, x = maps["sigma_deg"], maps["u_sigma_deg"], maps["x_mm"]
        assert str(maps["model"]) == "oren_nayar"
    assert sigma.shape == u.shape == (25, 25)
    assert x == pytest.approx(np.arange(-24, 25, 2))
    with h5py.File(run / "map.nxs") as file:
        data = file["entry/sigma_deg"]
        assert data.attrs["signal"] == "sigma_deg"
        assert data["sigma_deg"].attrs["units"] == "deg"
        assert np.array_equal(data["sigma_deg"][()], sigma, equal_nan=True)
        assert np.array_equal(data["sigma_deg_errors"][()], u, equal_nan=True)
        assert data["y"][0] == 24.0


@pytest.mark.usefixtures("plain_page")
def test_a_model_may_be_named_and_the_result_is_json(run: Path) -> None:
    model = "oren_nayar+torrance_sparrow"
    done = gonio_here("map", run, "--cell-mm", "3", "--model", model, "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert (run / "report.html").read_text().count('href="map.html"') == 1
    assert told["model"] == model
    assert (told["rows"], told["columns"]) == (16, 16)
    assert set(told["parameters"]) == {"albedo", "sigma_deg", "ks"}
    truth = {"albedo": (0.8, 0.02), "sigma_deg": (20.0, 1.0), "ks": (0.076, 0.02)}
    for name, (value, within) in truth.items():
        assert told["parameters"][name]["median"] == pytest.approx(value, abs=within)
    assert told["parameters"]["albedo"]["beyond_u"] == pytest.approx(0.016, abs=0.012)  # mottling


@pytest.mark.usefixtures("plain_page")
def test_what_cannot_be_mapped_is_refused_before_a_file_is_written(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bare = Path(shutil.copytree(run, tmp_path / "bare"))
    shutil.rmtree(bare / "frames")
    for arguments, words in (
        ((bare,), "frames that the record names are missing: frames/0000"),
        ((run, "--cell-mm", "0.2"), "cell_mm: 0.2 mm; allowed: 0.5625"),
        ((run, "--model", "ggx"), "--model: ggx; allowed for a map: oren_nayar, "),
        ((tmp_path / "nowhere",), "nowhere"),
    ):
        done = gonio_here("map", *arguments)
        assert done.returncode == 2
        assert words in " ".join(done.stderr.split())
    monkeypatch.setitem(sys.modules, "h5py", None)
    (run / "map.npz").unlink(missing_ok=True)
    done = gonio_here("map", run, "--cell-mm", "3", "--nexus")
    assert done.returncode == 2
    assert "pip install 'gonio[nexus]'" in done.stderr
    assert not (run / "map.npz").exists()
