"""The house itself: whose modules are imported, and how quickly the command answers."""

from __future__ import annotations

import subprocess
import sys
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


def test_the_report_is_the_only_one_that_needs_matplotlib() -> None:
    script = "import acquisition.commands.scan, sys; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0


def test_a_waiting_test_carries_its_mark_in_its_own_file() -> None:
    """`make test` looks for the mark in the text of tests/**/test_*.py, and runs those files."""
    mark = "pytest.mark." + "waits"
    helpers = [p for p in (ROOT / "tests").rglob("*.py") if not p.name.startswith("test_")]
    assert helpers
    assert not [p.name for p in helpers if mark in p.read_text()]
    assert mark.replace(".", r"\.") in (ROOT / "Makefile").read_text()
