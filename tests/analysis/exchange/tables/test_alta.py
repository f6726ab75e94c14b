"""ALTA text with error bars: read back by an independent reader and by the program's own."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.exchange.tables import alta
from instrument.errors import InputError
from instrument.text.text_file import TextFile
from tests.support.exchange.alta_reader import read_alta
from tests.support.exchange.random_tables import random_export, relative

HEAD = "#DIM 3 1\n#PARAM_IN ISOTROPIC_TV_TL_DPHI\n#PARAM_OUT INV_STERADIAN\n"


def text_file(text: str) -> TextFile:
    return TextFile("mine.alta", text.split("\n"))


@pytest.mark.parametrize("seed", range(40))
def test_another_reader_finds_the_values_as_measured(seed: int) -> None:
    export = random_export(seed)
    ((name, content),) = alta.files(export, "mine")
    found = read_alta(content.decode())
    table, angles = export.table, export.table.geometry
    assert name == "mine.alta"
    assert all(line.isprintable() for line in content.decode().split("\n"))
    assert (found.inputs, found.outputs) == ("ISOTROPIC_TV_TL_DPHI", "INV_STERADIAN")
    np.testing.assert_allclose(np.degrees(found.rows[:, 0]), angles.theta_r_deg, rtol=1e-14)
    np.testing.assert_allclose(np.degrees(found.rows[:, 1]), angles.theta_i_deg, rtol=1e-14)
    np.testing.assert_allclose(np.cos(found.rows[:, 2]), angles.cos_dphi, atol=1e-14)
    assert found.rows[:, 3].tolist() == table.brdf.tolist()
    assert found.segment == int(np.isfinite(table.u_brdf).all())
    if found.segment:
        assert found.rows[:, 4].tolist() == table.u_brdf.tolist()


@pytest.mark.parametrize("seed", range(40))
def test_the_program_reads_its_own_file(seed: int) -> None:
    export = random_export(seed)
    file = text_file(next(alta.files(export, "mine"))[1].decode())
    assert alta.is_alta(file)
    table, written = alta.read(file), export.table
    assert table.brdf.tolist() == written.brdf.tolist()
    np.testing.assert_array_equal(table.u_brdf, written.u_brdf)
    for name in ("theta_i_deg", "theta_r_deg", "dphi_deg"):
        read, there = (getattr(t.geometry, name) for t in (table, written))
        np.testing.assert_allclose(read, there, rtol=0, atol=1e-9)


def test_values_without_u_have_no_radius() -> None:
    export = random_export(1)
    export.table.u_brdf[:1] = np.nan
    text = next(alta.files(export, "mine"))[1].decode()
    assert "#VS" not in text.replace("(#VS)", "")
    assert read_alta(text).segment == 0


def test_relative_values_are_refused() -> None:
    with pytest.raises(InputError, match=r"--format alta: .*1/sr.*white tile"):
        list(alta.files(relative(random_export(1)), "mine"))


def test_foreign_angles_and_bounds_are_read() -> None:
    isotropic = alta.read(text_file(HEAD + "#VS 2\n0.1 -0.5 0 .2 .1 .4\n"))
    np.testing.assert_allclose(isotropic.geometry.theta_i_deg, np.degrees([0.5]), atol=1e-9)
    assert isotropic.geometry.dphi_deg.tolist() == [180.0]
    np.testing.assert_allclose(isotropic.u_brdf, [0.15])
    spherical = HEAD.replace("3 1", "4 1").replace("ISOTROPIC_TV_TL_DPHI", "SPHERICAL_TL_PL_TV_PV")
    table = alta.read(text_file(spherical + "0.5 1 0.1 3 .2\n"))
    np.testing.assert_allclose(table.geometry.theta_i_deg, np.degrees([0.5]), atol=1e-9)
    np.testing.assert_allclose(table.geometry.dphi_deg, np.degrees([2.0]), atol=1e-9)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (HEAD + "0 0 0 nan", r"mine.alta:4:7: brdf: 'nan' is not finite; allowed: "),
        (HEAD + "1.6 0 0 1", r":4:1: theta_r: 1.6 rad; allowed: -1.570796 to 1.570796 rad"),
        (HEAD + "0 0 0", r":4:1: row: 3 numbers; allowed: 4, as the header says"),
        (HEAD + "#VS 1\n0 0 0 1 -1", r":5:9: radius \(#VS\): -1 1/sr; allowed: 0 to 1e15"),
        (HEAD + "#VS x\n0 0 0 1", r"#VS 'x'; allowed: 0, 1 or 2"),
        (HEAD, r"no row of values; allowed: rows of angles"),
        (HEAD.replace("3 1", "3 3") + "0 0 0 1 1 1", r"#DIM 3 3; allowed: 3 1 for ISOTROPIC"),
        (HEAD.replace("DIM 3 1", "DIM 9999999999 1") + "0 0 0 1", r"#DIM 0 0; allowed: 3 1"),
        (HEAD.replace("ISOTROPIC_TV_TL_DPHI", "RUSIN_TH_TD"), r"#PARAM_IN 'RUSIN_TH_TD'; allowed"),
        (HEAD.replace("RADIAN\n", "RADIAN_COSINE_FACTOR\n"), r"#PARAM_OUT .*; allowed: INV_STERAD"),
    ],
)
def test_a_bad_file_names_line_and_value(text: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        alta.read(text_file(text))
