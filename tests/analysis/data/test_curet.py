"""CUReT reader: the published tables where present, and small ones in the same format."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path

import numpy as np
import pytest

from analysis.data.curet import Curet, read_curet
from analysis.fit.fit import fit
from analysis.models import MODELS
from instrument.errors import InputError
from tests.support.analysis.curet_texts import TABLE, VALUES
from tests.support.paths import ROOT

PUBLISHED = ROOT.parent / "shared" / "data" / "curet"
published = pytest.mark.skipif(
    not PUBLISHED.is_dir(), reason="the CUReT tables are not in ../shared/data/curet"
)


def write(table: str = TABLE, values: str = VALUES) -> Path:
    folder = Path("curet")
    folder.mkdir(exist_ok=True)
    (folder / "table.txt").write_text(table)
    (folder / "abrdf.dat").write_text(values)
    return folder


def problems(folder: Path, sample: int = 1, max_theta_deg: float = 90.0) -> tuple[str, ...]:
    with pytest.raises(InputError) as caught:
        read_curet(folder, sample, max_theta_deg)
    return caught.value.problems


def counts(curet: Curet) -> tuple[int, ...]:
    return curet.measurements.size, curet.negative, curet.zero, curet.beyond, curet.directions


def test_a_sample_in_degrees_by_the_convention_of_the_program() -> None:
    curet = read_curet(write(), 2)
    m = curet.measurements
    np.testing.assert_allclose(m.theta_r_deg, [np.degrees(0.5), 90, np.degrees(0.3)])
    np.testing.assert_allclose(m.theta_i_deg, [np.degrees(0.4), 0, np.degrees(1.2)])
    np.testing.assert_allclose(m.dphi_deg, np.degrees([0, 0.5, 0.75]), atol=1e-12)
    assert m.brdf.tolist() == [0.3, 0.25, 0.125]
    assert m.u_random is None
    assert m.theta_r_deg[1] == 90  # 1.570797 rad is 90 degrees within rounding
    assert counts(curet) == (3, 1, 0, 0, 4)


def test_values_left_out_are_counted_within_the_requested_directions() -> None:
    assert counts(read_curet(write(), 1)) == (3, 0, 1, 0, 4)
    assert counts(read_curet(write(), 1, 80.0)) == (3, 0, 0, 1, 4)
    assert counts(read_curet(write(), 2, 60.0)) == (1, 1, 0, 2, 4)
    # A limit that rounds to 0.400000 rad, as printed in the table, includes that direction.
    assert counts(read_curet(write(), 1, float(np.degrees(0.4 - 5e-7)))) == (1, 0, 0, 3, 4)


def test_the_result_is_frozen() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        read_curet(write(), 1).zero = 5  # type: ignore[misc]  # wrong on purpose


def test_comments_blank_lines_and_crlf() -> None:
    table = "# directions\r\n\r\n" + TABLE.replace("\n", "\r\n")
    assert counts(read_curet(write(table, "\n" + VALUES), 2)) == (3, 1, 0, 0, 4)


THETA = "allowed: a number from 0 to 1.570796 rad"

# Text to replace, replacement, and the whole message, with positions counted by hand.
TABLE_MISTAKES = {
    "text": ("0.500000  -1.57", "x.500000  -1.57", f"1:4: theta_v: 'x.500000' is text; {THETA}"),
    "not finite": (
        "3.141593",
        "     inf",
        "2:20: phi_v: 'inf' is not finite; allowed: a number from -1e6 to 1e6 rad",
    ),
    "past 90 degrees": (
        "1.570797",
        "1.570798",
        f"3:4: theta_v: 1.570798 rad; {THETA}",
    ),
    "negative": ("1.200000", "-1.20000", f"4:25: theta_i: -1.20000 rad; {THETA}"),
    "number out of order": ("3  1", "4  1", "3:1: n: '4'; allowed: 3, as the rows count from 1"),
    "number not whole": ("1  0", "1. 0", "1:1: n: '1.'; allowed: 1, as the rows count from 1"),
    "too few": (
        "  0.250000",
        "  ",
        "4:33: row: 4 values; allowed: 5 (n theta_v phi_v theta_i phi_i)",
    ),
    "too many": (
        "0.250000",
        "0.250000 9",
        "4:45: row: 6 values; allowed: 5 (n theta_v phi_v theta_i phi_i)",
    ),
    "empty": (
        TABLE,
        "",
        "1:1: the file is empty; allowed: a row `n theta_v phi_v theta_i phi_i` for each direction",
    ),
}


@pytest.mark.parametrize("kind", TABLE_MISTAKES)
def test_a_mistake_in_the_directions(kind: str) -> None:
    old, new, message = TABLE_MISTAKES[kind]
    assert TABLE.count(old) == 1
    assert problems(write(table=TABLE.replace(old, new))) == (f"curet/table.txt:{message}",)


VALUE_MISTAKES = {
    "text": (
        "0.100",
        "0,100",
        "1:11: v2: '0,100' is text; allowed: -1e15 to 1e15 1/sr (write 0.100)",
    ),
    "not finite": ("0.100", "  nan", "1:13: v2: 'nan' is not finite; allowed: -1e15 to 1e15"),
    "too few": (
        "  0.050",
        "",
        "1:23: row: 3 values; allowed: 4, one for each row of table.txt",
    ),
    "too many": (
        "0.050",
        "0.050 1 2",
        "1:31: row: 6 values; allowed: 4, one for each row of table.txt",
    ),
    "no value": (
        "1  0.200  0.100  0.000  0.050",
        "1",
        "1:2: row: 0 values; allowed: 4, one for each row of table.txt",
    ),
    "one value": (
        "1  0.200  0.100  0.000  0.050",
        "1 0.2",
        "1:6: row: 1 value; allowed: 4, one for each row of table.txt",
    ),
    "sample not whole": (
        "7  0",
        "x  0",
        "3:1: sample: 'x' is not a whole number; allowed: the sample's number",
    ),
    "sample double": (
        "7  0",
        "1  0",
        "3:1: sample: 1 is already in line 1; allowed: each sample once",
    ),
    "sample unknown": ("1  0.2", "3  0.2", "1:1: sample: 1 is not in this file; allowed: 2-3, 7"),
    "empty": (VALUES, "\n", "1:1: no sample; allowed: a row `sample v1 v2 ...` for each material"),
}


@pytest.mark.parametrize("kind", VALUE_MISTAKES)
def test_a_mistake_in_the_values(kind: str) -> None:
    old, new, message = VALUE_MISTAKES[kind]
    assert VALUES.count(old) == 1
    (found,) = problems(write(values=VALUES.replace(old, new)))
    assert found.startswith(f"curet/abrdf.dat:{message}")
    assert len(found) - len(f"curet/abrdf.dat:{message}") <= len(" 1/sr")


def test_mistakes_in_both_files_are_reported_at_once() -> None:
    folder = write(TABLE.replace("0.500000  -1", "2.500000  -1"), VALUES.replace("0.100", "?.100"))
    assert [line.split(" ")[0] for line in problems(folder)] == [
        "curet/table.txt:1:4:",
        "curet/abrdf.dat:1:11:",
    ]


def test_three_mistakes_of_a_kind_are_listed() -> None:
    found = problems(write(table="x\n" * 30))
    assert [line.split(":")[1] for line in found[:6]] == ["1", "1", "2", "2", "3", "3"]
    assert found[-1].startswith("... and 27 more like curet/table.txt:3:")


@pytest.mark.parametrize("limit", [0.0, -1.0, 90.5, float("nan"), float("inf")])
def test_a_limit_outside_0_to_90_degrees(limit: float) -> None:
    words = f"max_theta_deg: {limit:g} deg; allowed: more than 0 deg and at most 90 deg"
    assert problems(write(), 1, limit) == (words,)


def test_no_positive_value_is_an_error() -> None:
    words = "curet/abrdf.dat: sample {} has no positive value with both angles at most {} deg;"
    assert problems(write(), 7)[0].startswith(words.format(7, 90))
    assert problems(write(), 1, 5.5)[0].startswith(words.format(1, 5.5))


def test_files_that_are_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    allowed = "allowed: a folder with table.txt and abrdf.dat"
    assert problems(Path("nowhere")) == (f"nowhere: no such folder; {allowed}",)
    Path("file").touch()
    assert problems(Path("file")) == (f"file: is not a folder; {allowed}",)
    Path("empty").mkdir()
    assert problems(Path("empty")) == (f"empty: has no table.txt and no abrdf.dat; {allowed}",)
    (write() / "abrdf.dat").unlink()
    assert problems(Path("curet")) == (f"curet: has no abrdf.dat; {allowed}",)
    Path("curet/abrdf.dat").mkdir()
    assert problems(Path("curet")) == ("curet/abrdf.dat: is a folder; allowed: a text file",)

    def refuse(_: object) -> None:
        raise PermissionError(13, os.strerror(13))

    monkeypatch.setattr(Path, "iterdir", refuse)
    assert problems(Path("curet")) == (f"curet: cannot be read: Permission denied; {allowed}",)


@published
def test_all_published_samples_are_read() -> None:
    """Counts of NOTES.md with the tables, made independently of this reader."""
    found = [read_curet(PUBLISHED, sample) for sample in range(1, 62)]
    assert {curet.directions for curet in found} == {205}
    assert {curet.beyond for curet in found} == {0}
    assert sum(curet.negative for curet in found) == 29
    assert sum(curet.zero for curet in found) == 14
    assert sum(curet.measurements.size for curet in found) == 61 * 205 - 29 - 14
    assert problems(PUBLISHED, 62)[0].endswith("sample: 62 is not in this file; allowed: 1-61")


@published
def test_directions_of_the_published_tables() -> None:
    asked = [read_curet(PUBLISHED, sample, 68.8) for sample in range(1, 62)]
    assert {curet.directions - curet.beyond for curet in asked} == {116}
    m = read_curet(PUBLISHED, 10).measurements
    assert m.size == 205
    off_plane = np.abs(np.sin(np.radians(m.dphi_deg)))
    assert np.sum(off_plane < np.sin(np.radians(1))) == 49


@published
@pytest.mark.parametrize(("limit", "rms"), [(90.0, 0.0497), (68.8, 0.0188)])
def test_the_published_plaster_fits_as_reported(limit: float, rms: float) -> None:
    """Check fits of NOTES.md; a wrong sense of dphi gives several times these residuals."""
    found = fit(MODELS["oren_nayar"], read_curet(PUBLISHED, 10, limit).measurements)
    assert found.rms_relative == pytest.approx(rms, rel=0.01)
    if limit == 90:
        assert found.values["albedo"] == pytest.approx(0.8484, abs=1e-3)
        assert found.values["sigma_deg"] == pytest.approx(22.0, abs=0.1)
