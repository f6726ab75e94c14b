"""Tables of other programs: recognised by content, read as written, and refused with a reason."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.data.measurements import Measurements
from analysis.exchange.exported import BrdfTable, Export
from analysis.exchange.formats import FORMATS
from analysis.exchange.imports import READERS, kind_of, read_foreign
from instrument.errors import InputError
from instrument.geometry import Geometry
from instrument.text.text_file import TextFile

THETA_R = np.arange(-75.0, 76.0, 5.0)


def export(noise: int = 0, **changed: np.ndarray) -> Export:
    """Export of a whole sweep at one incidence, as every format can hold."""
    brdf = np.random.default_rng(noise).normal(0.2, 0.1, THETA_R.size)
    values = {"brdf": brdf, "u_brdf": np.full(brdf.shape, 0.01)} | changed
    geometry = Geometry.from_degrees(theta_i=30.0, theta_r=THETA_R)
    return Export(table=BrdfTable(geometry=geometry, **values), own_table="")


def written(kind: str, exported: Export) -> str:
    return next(iter(FORMATS[kind].files(exported, "mine")))[1].decode()


def text_file(text: str) -> TextFile:
    return TextFile("mine", text.split("\n"))


def by_angle(m: Measurements) -> np.ndarray:
    rows = np.stack([m.theta_i_deg, m.theta_r_deg, m.dphi_deg, m.brdf], axis=1)
    return rows[np.argsort(m.theta_r_deg)]


@pytest.mark.parametrize("kind", READERS)
def test_an_export_is_recognised_and_read_with_signed_angles(kind: str) -> None:
    exported = export()
    file = text_file(written(kind, exported))
    assert kind_of(file) == kind
    m = read_foreign([file], kind)
    assert np.unique(m.lamp_setting).size == 1
    columns = (np.full(THETA_R.size, 30.0), THETA_R, 0 * THETA_R, exported.table.brdf)
    np.testing.assert_allclose(by_angle(m), np.transpose(columns), rtol=1e-12, atol=2e-6)
    assert sorted(m.brdf.tolist()) == sorted(exported.table.brdf.tolist())
    assert (m.u_random is None) == (kind != "alta")


@pytest.mark.parametrize("header", ["theta_i_deg,theta_r_deg,dphi_deg,brdf", "", "# a comment"])
def test_another_text_is_not_recognised(header: str) -> None:
    assert kind_of(text_file(f"{header}\n1,2,3,4")) is None


def test_repeats_are_refused_unless_they_are_averaged() -> None:
    lines = written("astm", export()).replace("NUM_POINTS 31", "NUM_POINTS 32").split("\n")
    text = "\n".join([*lines[:-1], lines[-2], ""])
    with pytest.raises(InputError, match=r"mine: 1 directions stand in it more than once.*--rep"):
        read_foreign([text_file(text)], "astm")
    assert read_foreign([text_file(text)], "astm", repeats=True).size == 32


def test_a_partly_known_u_is_refused() -> None:
    text = written("alta", export()).replace(" 0.01\n", " 0\n", 1)
    with pytest.raises(InputError, match=r"u is 0 or missing for 1 of 31 values"):
        read_foreign([text_file(text)], "alta")


@pytest.mark.parametrize("kind", READERS)
def test_a_damaged_file_is_read_or_refused(kind: str) -> None:
    """Letters, lines and pieces that go missing, stand twice or change: no other error."""
    rng, whole, refused = np.random.default_rng(5), written(kind, export(1)), 0
    for _ in range(60):
        at, length = rng.integers(len(whole)), rng.integers(1, 40)
        piece = str(rng.choice(["", "x", "-9e99", "nan", " ", "\n", "#", ",", whole[at : at + 90]]))
        file = text_file(whole[:at] + piece + whole[at + length :])
        try:
            read_foreign([file], kind, repeats=True)
        except InputError as error:
            refused += str(error).startswith("mine:")
    assert refused > 10
