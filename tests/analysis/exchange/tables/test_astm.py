"""ASTM E1392 text: read back by an independent reader and by the program's own."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.exchange.tables import astm
from instrument.errors import InputError
from instrument.text.text_file import TextFile
from tests.support.exchange.astm_reader import read_astm
from tests.support.exchange.random_tables import random_export, relative

HEAD = "NUM_POINTS 1\nVARS theta_i,phi_i,theta_s,phi_s,BRDF\n"


def text_file(text: str) -> TextFile:
    return TextFile("mine.astm", text.split("\n"))


@pytest.mark.parametrize("seed", range(40))
def test_another_reader_finds_the_values_as_measured(seed: int) -> None:
    export = random_export(seed)
    (name, content), *more = astm.files(export, "mine")
    count, names, numbers = read_astm(content.decode())
    wavelength = export.facts.get("wavelength_nm")
    assert name == "mine.astm"
    assert all(line.isprintable() for line in content.decode().split("\n"))
    assert count == export.table.size == len(numbers)
    assert names[:4] == ["theta_i", "phi_i", "theta_s", "phi_s"]
    assert names[4:] == [f"{wavelength}nm" if wavelength in {"550", "632.8"} else "BRDF"]
    assert numbers[:, 4].tolist() == export.table.brdf.tolist()
    angles = export.table.geometry
    np.testing.assert_allclose(np.degrees(numbers[:, 0]), angles.theta_i_deg, rtol=1e-14)
    np.testing.assert_allclose(np.degrees(numbers[:, 2]), angles.theta_r_deg, rtol=1e-14)
    dphi = np.degrees(numbers[:, 3] - numbers[:, 1])
    np.testing.assert_allclose(dphi, angles.dphi_deg, rtol=1e-14)
    assert [more_name for more_name, _ in more] == (
        [] if np.isnan(export.table.u_brdf).all() else ["mine.astm.u.csv"]
    )


@pytest.mark.parametrize("seed", range(40))
def test_the_program_reads_its_own_file(seed: int) -> None:
    export = random_export(seed)
    file = text_file(next(astm.files(export, "mine"))[1].decode())
    assert astm.is_astm(file)
    table = astm.read(file)
    assert table.brdf.tolist() == export.table.brdf.tolist()
    angles, written = table.geometry, export.table.geometry
    np.testing.assert_allclose(angles.theta_i_deg, written.theta_i_deg, rtol=0, atol=1e-9)
    np.testing.assert_allclose(angles.theta_r_deg, written.theta_r_deg, rtol=0, atol=1e-9)
    np.testing.assert_allclose(angles.dphi_deg, written.dphi_deg, rtol=0, atol=1e-9)


def test_relative_values_are_refused() -> None:
    with pytest.raises(InputError, match=r"--format astm: .*1/sr.*white tile"):
        list(astm.files(relative(random_export(1)), "mine"))


def test_a_foreign_order_azimuth_and_rounding_are_read() -> None:
    table = astm.read(
        text_file("NAME x\nVARS phi_i,theta_i,550nm,theta_s,phi_s\r\n3.1,1.570797,.2,-.1,3.1\n")
    )
    assert table.geometry.theta_i_deg.tolist() == [90.0]
    assert table.geometry.dphi_deg.tolist() == [180.0]
    assert table.brdf.tolist() == [0.2]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (HEAD + "0.1,0,0.2,0,nan", r"mine.astm:3:13: brdf: 'nan' is not finite; allowed: "),
        (HEAD + "1.6,0,0.2,0,1", r":3:1: theta_i: 1.6 rad; allowed: 0 to 1.570796 rad"),
        (HEAD + "0.1,0,30,0,1", r":3:7: theta_r: 30 rad; allowed: -1.57"),
        (HEAD + "0.1,0,0.2,0,1e300", r":3:13: brdf: 1e300 1/sr; allowed: -1e15"),
        (HEAD + "0.1,0,0.2,0", r":3:1: row: 4 numbers; allowed: 5"),
        (HEAD + "0.1,0,0.2,0,1\n" * 2, r":1:1: NUM_POINTS: '1'; allowed: 2"),
        (HEAD, r"NUM_POINTS: '1'; allowed: 0"),
        (HEAD.partition("\n")[2], r"no row of values; allowed: rows theta_i"),
        (HEAD.replace("BRDF", "R,G,B") + "0,0,0,0,1,2,3", r"3 columns of values; allowed: .* one"),
        ("free lines alone", r"no line VARS; allowed: rows theta_i"),
        (HEAD.replace("phi_s", "x") + "0,0,0,0,1", r"VARS: no single phi_s"),
    ],
)
def test_a_bad_file_names_line_and_value(text: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        astm.read(text_file(text))
