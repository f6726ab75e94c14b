"""The module `gonio` is the whole Python interface, documented, and nothing below depends on it."""

from __future__ import annotations

import ast
import inspect

import pytest

import gonio
from tests.support.paths import ROOT

FUNCTIONS = ("load", "read_table", "read_curet", "fit", "plan", "run", "open_rig", "gonio_scan",
             "fetch_table")  # fmt: skip


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_s_help_states_errors_and_units(name: str) -> None:
    text = inspect.getdoc(getattr(gonio, name)) or ""
    assert "Raises `" in text
    assert "Error" in text or "NotDetermined" in text


@pytest.mark.parametrize("kind", [gonio.Run, gonio.Table, gonio.PlannedScan])
def test_every_array_states_its_shape_and_a_unit(kind: type) -> None:
    arrays = {
        name: inspect.getdoc(member) or ""
        for name, member in vars(kind).items()
        if name.endswith(("_deg", "_per_sr", "_per_s", "_relative"))
    }
    assert len(arrays) >= 3
    for name, text in arrays.items():
        assert "(N,)" in text, name
        assert any(u in text for u in ("degrees", "1/sr", "per second", "relative")), name


def test_every_name_exists_and_is_documented() -> None:
    assert sorted(gonio.__all__) == sorted(set(gonio.__all__))
    for name in gonio.__all__:
        assert inspect.getdoc(getattr(gonio, name)), name


def test_the_module_holds_no_logic() -> None:
    tree = ast.parse((ROOT / "gonio.py").read_text())
    allowed = (ast.ImportFrom, ast.Assign, ast.Expr)
    assert all(isinstance(node, allowed) for node in tree.body)


def test_no_room_imports_the_front_door() -> None:
    rooms = ("instrument", "drivers", "analysis", "sim", "acquisition")
    sources = [path for room in rooms for path in (ROOT / room).rglob("*.py")]
    assert len(sources) > 100
    assert not [path for path in sources if "import gonio" in path.read_text()]
