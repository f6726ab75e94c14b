"""CSV tables for the tests of the reader, written into the folder of the test."""

from __future__ import annotations

from pathlib import Path

import pytest

from analysis.data.csv.table import read_csv
from analysis.data.measurements import Measurements
from instrument.errors import InputError

NAMES = ["theta_i_deg", "theta_r_deg", "dphi_deg", "brdf", "u_brdf"]
PLAIN = "theta_i_deg,theta_r_deg,dphi_deg,brdf,u_brdf\n30,-20.5,0,0.25,0.002\n30,10,0,-1e-3,0.002\n"
BARE = "theta_i_deg,theta_r_deg,dphi_deg,brdf\n30,-20.5,0,0.25\n30,10,0,0.24\n"
HEADER = "a header with theta_i_deg, theta_r_deg, dphi_deg, brdf and, where known, u_brdf"


def read(content: str | bytes) -> Measurements:
    path = Path("data.csv")
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return read_csv(path)


def problems(content: str | bytes) -> tuple[str, ...]:
    with pytest.raises(InputError) as caught:
        read(content)
    return caught.value.problems


def changed(text: str, old: str, new: str) -> str:
    assert text.count(old) == 1
    return text.replace(old, new)


def assert_mistake(text: str, old: str, new: str, message: str) -> None:
    """Replace a part of a table: the only problem begins with the message, nearly complete."""
    (found,) = problems(changed(text, old, new))
    assert found.startswith(f"data.csv:{message}")
    assert len(found) - len(f"data.csv:{message}") < 30  # the rest is covered by other tables
