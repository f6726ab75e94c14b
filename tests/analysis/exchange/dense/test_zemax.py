"""Zemax tabular BSDF: read back by an independent reader and by the program's own."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import ArrayLike

from analysis.exchange.dense import zemax
from analysis.exchange.dense.zemax_reader import is_zemax, read_zemax
from analysis.exchange.exported import BrdfTable, Export
from analysis.models import MODELS
from instrument.errors import InputError
from instrument.geometry import FloatArray, Geometry
from instrument.text.text_file import TextFile
from tests.support.exchange import zemax_reader
from tests.support.exchange.random_tables import random_export, relative, strange_text


def text_file(text: str) -> TextFile:
    return TextFile("mine.bsdf", text.split("\n"))


def sweeps(seed: int, azimuths: ArrayLike = 0.0) -> Export:
    """Random values in sweeps across both sides at one to three incidences."""
    rng = np.random.default_rng(seed)
    theta_i = rng.choice(np.arange(0.0, 61.0, 5.0), rng.integers(1, 4), replace=False)
    ends, step = rng.uniform(70, 89, 2), rng.choice([2.5, 5.0, 7.5])
    theta_r = np.arange(-round(ends[0], 1), ends[1], step)
    blind = rng.uniform(0, 8) if rng.random() < 0.5 else 0.0
    i, r, dphi = (a.ravel() for a in np.meshgrid(theta_i, theta_r, azimuths))
    seen = (np.abs(r - i) >= blind) | (dphi != 0)  # the camera hides the lamp
    geometry = Geometry.from_degrees(theta_i=i[seen], theta_r=r[seen], dphi=dphi[seen])
    brdf = rng.normal(0.2, 0.15, geometry.shape)
    table = BrdfTable(geometry=geometry, brdf=brdf, u_brdf=np.full(brdf.shape, 0.01))
    return Export(
        table=table, own_table="", facts={"sample": strange_text(rng), "notes": "a\nTIS 3"}
    )


def written(export: Export) -> str:
    return next(iter(zemax.files(export, "mine")))[1].decode()


def of_model(model: str, geometry: Geometry, **parameters: float) -> Export:
    brdf = MODELS[model].brdf(geometry, **parameters)
    u_brdf = np.full(brdf.shape, np.nan)
    table = BrdfTable(geometry=geometry, brdf=brdf, u_brdf=u_brdf)
    return Export(table=table, own_table="")


def marks(found: zemax_reader.ZemaxFile) -> np.ndarray[tuple[int, ...], np.dtype[np.str_]]:
    rows = [c.split()[3] for c in found.comments if c.startswith("marks ")]
    return np.array([list(row) for row in rows]).reshape(found.brdf.shape)


def sorted_rows(table: BrdfTable) -> FloatArray:
    angles = table.geometry
    dphi = np.where(angles.theta_r_deg < 1e-9, 0.0, angles.dphi_deg)  # free at the normal
    dphi = np.where(np.abs(dphi - 360) < 1e-6, 0.0, dphi)
    rows = np.stack([angles.theta_i_deg, angles.theta_r_deg, dphi, table.brdf], axis=1)
    return rows[np.lexsort(np.round(rows[:, :3].T, 6))]


@pytest.mark.parametrize("seed", range(30))
def test_another_reader_finds_each_value_at_its_direction(seed: int) -> None:
    export = sweeps(seed)
    found = zemax_reader.read_zemax(written(export))
    assert found.texts["Symmetry"] == "PlaneSymmetrical"
    assert found.axes["ScatterAzimuth"] == [0.0, 180.0]
    measured, count = marks(found) == "m", 0
    for n, theta_i in enumerate(found.axes["AngleOfIncidence"]):
        theta_r, dphi = (a[measured[n]] for a in found.angles(n))
        signed = np.where(np.abs(dphi) < 90, theta_r, -theta_r)
        points = export.table.geometry.theta_i_deg == theta_i
        side = np.where(export.table.geometry.cos_dphi > 0, 1, -1)[points]
        there = side * export.table.geometry.theta_r_deg[points]
        at = np.argmin(np.abs(signed[:, None] - there), axis=1)
        np.testing.assert_allclose(signed, there[at], atol=1e-6)
        assert found.brdf[n][measured[n]].tolist() == export.table.brdf[points][at].tolist()
        assert set(at) == set(range(there.size))
        count += there.size
    assert count == export.table.size


@pytest.mark.parametrize("seed", range(30))
def test_the_program_reads_the_measured_values_of_its_own_file(seed: int) -> None:
    export = sweeps(seed)
    file = text_file(written(export))
    assert is_zemax(file)
    np.testing.assert_allclose(
        sorted_rows(read_zemax(file)), sorted_rows(export.table), rtol=1e-12, atol=2e-6
    )


@pytest.mark.parametrize("azimuths", [0.0, np.arange(0.0, 180.0, 30.0)])
def test_a_lambertian_surface_reflects_its_albedo(azimuths: ArrayLike) -> None:
    i, r, dphi = np.meshgrid([0.0, 30.0, 60.0], np.arange(-75.0, 76.0, 5.0), azimuths)
    geometry = Geometry.from_degrees(theta_i=i.ravel(), theta_r=r.ravel(), dphi=dphi.ravel())
    found = zemax_reader.read_zemax(written(of_model("lambert", geometry, albedo=0.5)))
    np.testing.assert_allclose(found.tis, 0.5, rtol=1e-3)


@pytest.mark.parametrize("first", [0.0, 15.0])  # with the plane of incidence, and without it
def test_what_lies_between_azimuths_is_interpolated_and_marked(first: float) -> None:
    azimuths = np.arange(first, 180.0, 30.0)
    i, r, dphi = np.meshgrid([30.0], np.arange(-80.0, 81.0, 5.0), azimuths)
    geometry = Geometry.from_degrees(theta_i=i.ravel(), theta_r=r.ravel(), dphi=dphi.ravel())
    model = {"albedo": 0.6, "sigma_deg": 25.0}
    found = zemax_reader.read_zemax(written(of_model("oren_nayar", geometry, **model)))
    between = marks(found)[0] == "i"
    assert np.mean(between) > 0.3
    assert "h" not in marks(found)[0, :, 1:8]  # within 35 degrees of the specular direction
    theta_r, dphi = (a[between] for a in found.angles(0))
    nodes = Geometry.from_degrees(theta_i=30.0, theta_r=theta_r, dphi=dphi)
    truth = MODELS["oren_nayar"].brdf(nodes, **model)
    np.testing.assert_allclose(found.brdf[0][between], truth, rtol=0.03)


def test_repeats_are_averaged_and_the_ends_held() -> None:
    theta_r = [*np.arange(-75.0, 76.0, 5.0), 10.0]
    geometry = Geometry.from_degrees(theta_i=20.0, theta_r=theta_r)
    brdf = np.arange(len(theta_r)) / 100
    table = BrdfTable(geometry=geometry, brdf=brdf, u_brdf=np.full(brdf.shape, np.nan))
    found = zemax_reader.read_zemax(written(Export(table=table, own_table="")))
    radial = found.axes["ScatterRadial"]
    assert found.brdf[0, 0, radial.index(30.0)] == (brdf[17] + brdf[-1]) / 2
    assert found.brdf[0, 0, radial.index(110.0)] == brdf[-2]
    assert marks(found)[0, 0, radial.index(110.0)] == "h"
    assert marks(found)[0, 1, radial.index(75.0)] == "-"


def test_relative_values_are_refused() -> None:
    with pytest.raises(InputError, match=r"--format zemax: .*1/sr.*white tile"):
        list(zemax.files(relative(sweeps(1)), "mine"))


@pytest.mark.parametrize(
    "theta_r", [[10.0], -np.arange(0.0, 76.0, 5.0), np.arange(-50.0, 51.0, 5.0), [-80.0, 80.0]]
)
def test_a_sparse_scan_is_refused_with_what_would_be_needed(theta_r: ArrayLike) -> None:
    geometry = Geometry.from_degrees(theta_i=[[30.0], [0.0]], theta_r=theta_r)
    flat = Geometry(*(a.ravel() for a in (geometry.theta_i_deg, geometry.theta_r_deg,
                                          geometry.dphi_deg)))  # fmt: skip
    with pytest.raises(InputError, match=r"at theta_i .* from the nearest of .*allowed: 25.*scan"):
        list(zemax.files(of_model("lambert", flat, albedo=0.5), "mine"))


@pytest.mark.parametrize("seed", range(40))
def test_any_table_is_written_whole_or_refused(seed: int) -> None:
    export = random_export(seed)
    try:
        text = written(export)
    except InputError as error:
        found = str(error)
    else:
        found = "--format zemax: " * bool(np.all(np.isfinite(zemax_reader.read_zemax(text).brdf)))
    assert found.startswith("--format zemax: ")


FOREIGN = """#Data of somebody
Source\tMeasured
Symmetry  PlaneSymmetrical
SpectralContent  Monochrome
ScatterType  BRDF
SampleRotation  1
0
AngleOfIncidence  2
0\t30
ScatterAzimuth  3
0\t90\t180
ScatterRadial  2
0\t80

Monochrome
DataBegin
TIS 0.5
.1\t.2
.1\t.3
.1\t.4
TIS 0.5
.5\t.6
.5\t.7
.5\t.8
DataEnd
"""


def test_a_foreign_file_is_read_above_the_horizon_and_each_direction_once() -> None:
    table = read_zemax(text_file(FOREIGN))
    angles = table.geometry
    rows = [*zip(angles.theta_i_deg, angles.theta_r_deg, angles.dphi_deg, table.brdf, strict=True)]
    assert [round(float(row[3]), 3) for row in rows] == [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]
    np.testing.assert_allclose([row[1] for row in rows[:4]], [0, 80, 80, 80], atol=1e-9)
    np.testing.assert_allclose([row[2] for row in rows[1:4]], [0, 90, 180], atol=1e-9)
    np.testing.assert_allclose([row[1:3] for row in rows[4:6]], [[30, 180], [50, 0]], atol=1e-9)


def test_both_sides_of_a_foreign_file_are_read() -> None:
    text = FOREIGN.replace("PlaneSymmetrical", "Asymmetrical").replace("0\t90\t180", "0\t90\t270")
    table = read_zemax(text_file(text))
    np.testing.assert_allclose(table.geometry.dphi_deg[1:4], [0, 90, 270], atol=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("0.5\n.5", "0.5\nnan", r"mine.bsdf:22:1: brdf: 'nan' is not finite; allowed: "),
        ("\t30", "\t95", r":9:3: theta_i_deg: 95 deg; allowed: a number from 0 to 90 deg"),
        ("\t180", "\t400", r":11:6: ScatterAzimuth: 400 deg; allowed: 0 to 360 deg"),
        ("ScatterRadial  2", "ScatterRadial  9999999", r":12:16: number: 9999999; allowed: 1 to"),
        ("ScatterRadial  2", "ScatterRadial  3", r"'TIS'|keyword|text; allowed"),
        ("BRDF", "BTDF", r"ScatterType: 'BTDF'; allowed: BRDF"),
        ("Monochrome\nS", "XYZ\nS", r"SpectralContent: 'XYZ'; allowed: Monochrome"),
        ("Source\tMeasured\n", "", r"Source: nothing; allowed: Measured"),
        ("SampleRotation  1\n0", "SampleRotation  2\n0 90", r"2 rotations; allowed: 1; keep one"),
        ("Source", "Sauce", r":2:1: keyword: 'Sauce'; allowed: Source, Symmetry"),
        ("DataEnd\n", "", r"ends before DataEnd; allowed: a complete file"),
        ("TIS 0.5\n.1", "TUS 0.5\n.1", r":17:1: 'TUS'; allowed: TIS"),
        ("ScatterAzimuth  3\n0\t90\t180\n", "", r"no ScatterAzimuth; allowed: ScatterAzimuth, a n"),
    ],
)
def test_a_bad_file_names_line_and_value(old: str, new: str, words: str) -> None:
    assert old in FOREIGN
    with pytest.raises(InputError, match=words):
        read_zemax(text_file(FOREIGN.replace(old, new, 1)))


def test_axes_of_an_absurd_size_are_refused_before_values_are_read() -> None:
    axis = "\n".join(["10000", *map(str, np.linspace(0, 90, 10000))])
    text = FOREIGN
    for name in ("ScatterAzimuth", "ScatterRadial"):
        start = text.index(name) + len(name)
        end = text.index("\n", text.index("\n", start) + 1)
        text = f"{text[:start]} {axis}{text[end:]}"
    with pytest.raises(InputError, match=r"200000000 values; allowed: 2000000; split"):
        read_zemax(text_file(text))
