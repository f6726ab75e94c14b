"""File of a tile's radiance factors: what it may be, and a clear error for all else."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from instrument.calibration.tile_file import read_tile_table
from instrument.calibration.tile_table import ANGLES, TileTable
from instrument.errors import InputError

TABLE = """\
# tile 4711, 550 nm
theta_i_deg,theta_r_deg,dphi_deg,beta,u_beta
0,10,0,1.052,0.003
0,10,180,1.052,0.003
30,10,0,1.021,0.003
30,10,180,1.026,0.004

60,10,0,0.951,0.003
60,10,180,0.972,0.005
"""
ORDER = "allowed: rows sorted by theta_i_deg, then theta_r_deg, then dphi_deg, each geometry once"

# Text to replace, replacement, and the whole message, with positions counted by hand.
MISTAKES = {
    "unsorted": (
        "30,10,180,1.026",
        "30,10,-180,1.026",
        f"6:7: dphi_deg: -180 deg after 0 deg in line 5; {ORDER}",
    ),
    "a typing error in an angle": (
        "60,10,0,",
        "6.0,10,0,",
        f"8:1: theta_i_deg: 6 deg after 30 deg in line 6; {ORDER}",
    ),
    "the same geometry": (
        "30,10,180,1.026",
        "30,10,0,1.026",
        f"6:1: theta_i_deg: the same three angles as in line 5; {ORDER}",
    ),
    "a gap": (
        "30,10,0,1.021,0.003\n",
        "",
        "5:1: row: there is none for theta_i 30, theta_r 10, dphi 0 deg before it; allowed: a "
        "complete grid, here of 3 x 1 x 2 = 6 rows, and not 5",
    ),
    "a gap at the end": (
        "60,10,180,0.972,0.005\n",
        "",
        "9:1: row: there is none for theta_i 60, theta_r 10, dphi 180 deg before it; allowed: a "
        "complete grid, here of 3 x 1 x 2 = 6 rows, and not 5",
    ),
    "nan": (
        "1.026",
        "nan",
        "6:11: beta: 'nan' is not finite; allowed: 0.001 to 5, not in %",
    ),
    "no number": (
        "1.026",
        "",
        "6:11: beta: is empty; allowed: 0.001 to 5, not in %",
    ),
    "a decimal comma": (
        "1.026",
        '"1,026"',
        "6:11: beta: '1,026' is text; allowed: 0.001 to 5, not in % (write 1.026)",
    ),
    "degrees out of range": (
        "30,10,0,1.021",
        "30,100,0,1.021",
        "5:4: theta_r_deg: 100 deg; allowed: -90 to 90 deg",
    ),
    "per cent": (
        "1.026",
        "102.6",
        "6:11: beta: 102.6; allowed: 0.001 to 5, not in %",
    ),
    "u in per cent": (
        "0.004",
        "0.8",
        "6:17: u_beta: 0.8; allowed: less than half of beta 1.026 (k = 1, absolute and not in %)",
    ),
    "a negative u": (
        "0.004",
        "-0.004",
        "6:17: u_beta: -0.004; allowed: 0 to 5, k = 1, in the unit of beta",
    ),
    "a field too many": (
        "1.026,0.004",
        "1.026,0.004,",
        "6:1: row: 6 fields; allowed: 5, as in the header",
    ),
    "an unknown column": (
        "u_beta\n",
        "u_betta\n",
        "2:39: header: unknown column 'u_betta'; did you mean u_beta? allowed: theta_i_deg, "
        "theta_r_deg, dphi_deg, beta, u_beta and perhaps u_beta_common",
    ),
    "a column twice": (
        "beta,u_beta\n",
        "beta,beta,u_beta\n",
        "2:34: header: beta stands twice; allowed: each once",
    ),
}


def read(text: str) -> object:
    Path("tile.csv").write_text(text)
    return read_tile_table(Path("tile.csv"))


def first_problem(text: str) -> str:
    with pytest.raises(InputError) as caught:
        read(text)
    return caught.value.problems[0]


@pytest.mark.parametrize("kind", MISTAKES)
def test_a_mistake_is_named_with_its_position(kind: str) -> None:
    old, new, message = MISTAKES[kind]
    assert TABLE.count(old) == 1
    assert first_problem(TABLE.replace(old, new)) == f"tile.csv:{message}"


def test_one_row_no_row_and_no_text_are_refused() -> None:
    lines = TABLE.splitlines()
    assert first_problem("\n".join(lines[:3])) == (
        "tile.csv:3:1: row: one row after the header; allowed: 2 or more; for one number take the "
        "keys reflectance and u_reflectance"
    )
    assert first_problem("\n".join(lines[:2])).startswith("tile.csv:2:1: row: no row after the")
    assert first_problem("").startswith("tile.csv:1:1: the file is empty; allowed: a header with")
    missing = first_problem("theta_i_deg,beta\n1,1\n")
    assert missing.startswith("tile.csv:1:1: header: theta_r_deg, dphi_deg, u_beta is missing")


def test_every_mistake_is_reported_at_once() -> None:
    text = TABLE.replace("1.021", "x").replace("0.951", "-1").replace("60,10,180", "60,10,500")
    with pytest.raises(InputError) as caught:
        read(text)
    assert [p.split(":")[1:3] for p in caught.value.problems] == [
        ["5", "9"],
        ["8", "9"],
        ["9", "7"],
    ]


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_any_grid_is_read_as_it_is_written(seed: int) -> None:
    """Columns in any order, each angle the slowest, with or without the common u, CRLF or LF."""
    random = np.random.default_rng(seed)
    limits = {"theta_i_deg": (0, 90), "theta_r_deg": (-90, 90), "dphi_deg": (-360, 360)}
    sizes = dict(zip(ANGLES, [int(random.integers(2, 5)), *random.integers(1, 4, 2)], strict=True))
    axes = {n: np.sort(random.choice(np.arange(*limits[n]), sizes[n], False)) for n in ANGLES}
    values = ["beta", "u_beta", *["u_beta_common"] * bool(random.integers(2))]
    names = [str(name) for name in random.permutation([*ANGLES, *values])]
    order = [name for name in names if name in ANGLES]
    written: dict[tuple[float, ...], dict[str, float]] = {}
    lines = [",".join(names)]
    for angles in product(*(axes[name].tolist() for name in order)):
        row = dict(zip(order, angles, strict=True))
        row |= {"beta": float(random.uniform(0.5, 1.5))}
        row |= {name: float(random.uniform(0, 0.1)) for name in values[1:]}
        written[tuple(row[name] for name in ANGLES)] = row
        lines.append(",".join(repr(row[name]) for name in names))
    table = read(["\n", "\r\n"][random.integers(2)].join(lines))
    assert [axis.tolist() for axis in table.axes_deg] == [axes[name].tolist() for name in ANGLES]
    for index in np.ndindex(table.beta.shape):
        row = written[tuple(a[i] for a, i in zip(table.axes_deg, index, strict=True))]
        found = (table.beta[index], table.u_beta[index], table.u_common[index])
        assert found == (row["beta"], row["u_beta"], row.get("u_beta_common", 0.0))


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1))
def test_any_damaged_file_is_read_or_refused_with_a_place(seed: int) -> None:
    """Bytes lost, doubled, exchanged or made up."""
    random, raw = np.random.default_rng(seed), bytearray(TABLE.encode())
    for _ in range(int(random.integers(1, 6))):
        at, kind = int(random.integers(len(raw))), int(random.integers(4))
        if kind == 0:
            raw[at] = int(random.integers(256))
        elif kind == 1:
            del raw[at : at + int(random.integers(1, 40))]
        elif kind == 2:
            raw[at:at] = raw[at : at + int(random.integers(1, 40))]
        else:
            raw[at:at] = bytes(random.choice(list(b'0123456789.,-\n"#en'), 3).tolist())
    Path("tile.csv").write_bytes(bytes(raw))
    found = table_or_problems(Path("tile.csv"))
    if isinstance(found, TileTable):
        assert found.beta.size >= 2
        assert np.all(np.isfinite(found.beta) & (found.u_beta < found.beta / 2))
    else:
        assert all(problem.startswith(("tile.csv:", "... and")) for problem in found)


def table_or_problems(path: Path) -> TileTable | tuple[str, ...]:
    try:
        return read_tile_table(path)
    except InputError as error:
        return error.problems
