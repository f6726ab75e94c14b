"""The house itself: whose modules are imported, and how quickly the command answers."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from importlib.resources import files
from pathlib import Path

import pytest

from tests.support.paths import ROOT

PACKAGES = ["instrument", "drivers", "analysis", "sim", "acquisition"]


def test_each_package_is_imported_from_this_tree(tmp_path: Path) -> None:
    script = f"import {', '.join(PACKAGES)}\nfor m in ({', '.join(PACKAGES)}): print(m.__file__)"
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert [Path(line) for line in done.stdout.split()] == [
        ROOT / package / "__init__.py" for package in PACKAGES
    ]


@pytest.mark.parametrize("heavy", ["numpy", "scipy", "cv2", "matplotlib", "pydantic"])
def test_the_help_imports_nothing_heavy(heavy: str) -> None:
    script = f"import acquisition.cli, sys; sys.exit('{heavy}' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0


@pytest.mark.parametrize("heavy", ["scipy", "matplotlib", "serial", "pymodbus"])
def test_scan_and_fit_import_no_library_that_most_runs_do_not_need(heavy: str) -> None:
    """SciPy is for profiles, long scans and nothing else; Matplotlib for the report."""
    needed = "acquisition.commands.scan, acquisition.results.finish"
    script = f"import {needed}, sys; sys.exit('{heavy}' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0


def test_a_waiting_test_carries_its_mark_in_its_own_file() -> None:
    """`make test` looks for the mark in the text of tests/**/test_*.py, and runs those files."""
    mark = "pytest.mark." + "waits"
    helpers = [p for p in (ROOT / "tests").rglob("*.py") if not p.name.startswith("test_")]
    assert helpers
    assert not [p.name for p in helpers if mark in p.read_text()]
    assert mark.replace(".", r"\.") in (ROOT / "Makefile").read_text()


def test_the_shipped_configuration_is_part_of_the_package() -> None:
    """What pyproject.toml packs: every YAML file, found as an installed program finds it."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        setup = tomllib.load(file)["tool"]["setuptools"]
    assert "configs" in setup["packages"]
    shipped = files("configs")
    folder = ROOT / "configs"
    packed = {p for form in setup["package-data"]["configs"] for p in folder.glob(form)}
    assert packed == set(folder.rglob("*.yaml"))
    assert all(shipped.joinpath(*p.relative_to(folder).parts).is_file() for p in packed)


def test_every_folder_with_modules_is_a_listed_package() -> None:
    """A folder that pyproject.toml does not list would be missing from an installed program."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        listed = set(tomllib.load(file)["tool"]["setuptools"]["packages"])
    rooms = {p.parent for top in (*PACKAGES, "configs") for p in (ROOT / top).rglob("*.py")}
    assert {".".join(room.relative_to(ROOT).parts) for room in rooms} == listed
