"""Commands `gonio calibrate board` and `geometry`: files, words, exit codes, nothing half done."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from instrument.calibration.geometry_file import read_geometry_file
from tests.support.command import gonio_here as gonio
from tests.support.paths import CONFIGS

BENCH = CONFIGS / "rigs" / "bench_12bit.yaml"


def test_a_board_is_written_once(tmp_path: Path) -> None:
    page = tmp_path / "board.pdf"
    done = gonio("calibrate", "board", "-o", page, "--square-mm", "7.5")
    assert done.returncode == 0, done.stderr
    assert "6 x 6 squares of 7.5 mm" in done.stdout
    before = page.read_bytes()
    again = gonio("calibrate", "board", "-o", page)
    assert (again.returncode, page.read_bytes()) == (2, before)
    for wrong in (("-o", tmp_path / "board.png"), (), ("-o", page, "--rows", "99")):
        assert gonio("calibrate", "board", *wrong).returncode == 2
    assert [p.name for p in tmp_path.iterdir()] == ["board.pdf"]


def test_a_geometry_is_written_with_its_values(tmp_path: Path) -> None:
    quick = ("--poses", "5", "--frames", "1", "--json", "--theta-i-deg", "15")
    out = tmp_path / "geometry.npz"
    done = gonio("calibrate", "geometry", "--rig", BENCH, "-o", out, *quick)
    assert done.returncode == 0, done.stderr
    told, kept = json.loads(done.stdout), read_geometry_file(out)
    assert told["sha256"] == kept.sha256
    assert told["quantities"]["theta_i_zero_error_deg"]["value"] is None
    assert any("zero of theta_i is not determined" in note for note in told["notes"])
    assert kept.field_width_mm == pytest.approx(72.0, rel=1e-3)
    assert kept.roll_deg == pytest.approx(0.4, abs=0.02)
    assert kept.zero_deg == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize(
    ("light", "options", "code", "words"),
    [
        (6e5, ("--poses", "3"), 2, "--poses 3; allowed: 5 to 60"),
        (5.0, ("--poses", "5"), 5, "at theta_r -60 deg: no markers of DICT_4X4_50 found"),
    ],
)
def test_what_fails_leaves_no_file(
    tmp_path: Path, light: float, options: tuple[str, ...], code: int, words: str
) -> None:
    rig = tmp_path / "rig.yaml"
    text = BENCH.read_text()
    dimmed = text.replace("white_electrons_per_s: 600000.0", f"white_electrons_per_s: {light}")
    rig.write_text(dimmed)
    own = ("--rig", rig, "-o", tmp_path / "g.npz", "--theta-i-deg", "15", "--frames", "1")
    done = gonio("calibrate", "geometry", *own, *options)
    assert (done.returncode, done.stdout) == (code, "")
    assert words in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["rig.yaml"]
