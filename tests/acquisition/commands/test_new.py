"""`gonio new rig` and `gonio new protocol`: a pair of files that `gonio plan` accepts at once."""

from __future__ import annotations

import io
import sys
from pathlib import Path

import pytest

from acquisition.commands import new
from instrument.errors import InputError, OperatorStop
from tests.support.command import gonio_here as gonio

SIMULATED = ("--defaults", "--set", "camera=simulated")


def test_the_pair_is_planned_at_once(tmp_path: Path) -> None:
    (tmp_path / "scans").mkdir()
    rig = gonio("new", "rig", "-o", "my rig.yaml", *SIMULATED, cwd=tmp_path)
    assert (rig.returncode, rig.stderr) == (0, "")
    scan = ("new", "protocol", "--rig", "my rig.yaml", "-o", "scans/foam.yaml")
    protocol = gonio(*scan, "--set", "theta_i_deg=20 40", cwd=tmp_path)
    assert (protocol.returncode, protocol.stderr) == (0, "")
    assert 'rig: "../my rig.yaml"' in (tmp_path / "scans/foam.yaml").read_text().replace("'", '"')
    planned = gonio("plan", "scans/foam.yaml", cwd=tmp_path)
    assert planned.returncode == 0
    assert "my rig (simulated)" in planned.stdout


def test_nothing_is_overwritten_and_nothing_is_left_half_written(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("mine")
    (tmp_path / "link.yaml").symlink_to(tmp_path / "nowhere.yaml")
    for name, reason in {
        "mine.yaml": "exists already: choose another name",
        "link.yaml": "exists already",
        "rig.txt": "must end in .yaml or .yml",
        "gone/rig.yaml": "there is no folder",
    }.items():
        done = gonio("new", "rig", "-o", tmp_path / name, *SIMULATED)
        assert done.returncode == 2
        assert reason in done.stderr
    wrong = gonio("new", "rig", "-o", tmp_path / "new.yaml", *SIMULATED, "--set", "camera.size=9")
    assert wrong.returncode == 2
    assert "--set camera.size: '9'; allowed: width x height" in wrong.stderr
    assert sorted(p.name for p in tmp_path.iterdir()) == ["link.yaml", "mine.yaml"]
    assert (tmp_path / "mine.yaml").read_text() == "mine"


def test_an_option_that_is_missing_or_wrong_is_named(tmp_path: Path) -> None:
    assert "-o FILE.yaml" in gonio("new", "rig").stderr
    out = ("-o", tmp_path / "p.yaml")
    no_rig = gonio("new", "protocol", *out)
    assert no_rig.returncode == 2
    assert "--rig FILE" in no_rig.stderr
    assert "no such file" in gonio("new", "protocol", "--rig", tmp_path / "r.yaml", *out).stderr
    for given, reason in (("name", "KEY=VALUE"), ("colour=red", "--set colour: no question")):
        done = gonio("new", "rig", "-o", tmp_path / "r.yaml", *SIMULATED, "--set", given)
        assert done.returncode == 2
        assert reason in done.stderr
    with pytest.raises(InputError, match="--set a: is given twice"):
        new.new_rig(tmp_path / "r.yaml", ["a=1", "a=2"], defaults=True, identify=False)


class _Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_person_at_a_terminal_is_asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A wrong answer is named and asked for again; Enter takes the default."""
    typed = _Terminal("simulated\n\nfar\n850\n" + 40 * "\n")
    monkeypatch.setattr(sys, "stdin", typed)
    new.new_rig(tmp_path / "rig.yaml", [], defaults=False, identify=False)
    asked = capsys.readouterr().err
    assert "Enter takes the value in brackets" in asked
    assert "beam_length_mm: 'far'; allowed: a number greater than 0" in asked
    assert "beam_length_mm: 850.0" in (tmp_path / "rig.yaml").read_text()
    monkeypatch.setattr(sys, "stdin", _Terminal("q\n"))
    with pytest.raises(OperatorStop, match="nothing is written"):
        new.new_rig(tmp_path / "second.yaml", [], defaults=False, identify=False)
    assert [p.name for p in tmp_path.iterdir()] == ["rig.yaml"]
