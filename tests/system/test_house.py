"""Structure of the project: its rooms and their size, imports, and what is packaged."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tomllib
from collections import Counter
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


def _loaded_by(modules: str) -> set[str]:
    """Modules that a new process has after an import."""
    script = f"import {modules}, sys; print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    return set(done.stdout.split())


def test_the_help_imports_nothing_heavy() -> None:
    heavy = {"numpy", "scipy", "cv2", "matplotlib", "pydantic"}
    assert not heavy & _loaded_by("acquisition.cli")


def test_scan_and_fit_import_no_library_that_most_runs_do_not_need() -> None:
    """SciPy is for profiles, long scans and nothing else; Matplotlib for the report.

    The devices and the plan for a run engine leave its library to whoever runs one.
    """
    needed = "acquisition.commands.scan, acquisition.results.finish"
    driven = "acquisition.facility.plans, acquisition.facility.devices.rig_devices"
    foreign = {"bluesky", "event_model", "ophyd_async", "tiled", "bluesky_queueserver"}
    heavy = {"scipy", "matplotlib", "serial", "pymodbus"} | foreign
    assert not heavy & _loaded_by(f"{needed}, {driven}")


def test_neither_scan_nor_fits_nor_maps_import_the_cluster() -> None:
    """Dask is for `--all --scheduler`, and imported once that is called."""
    needed = (
        "acquisition.commands.scan, acquisition.commands.fit, acquisition.commands.many.fit_all, "
        "acquisition.commands.many.map_all"
    )
    assert not {"dask", "distributed", "tornado"} & _loaded_by(needed)


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


def _tracked() -> list[Path]:
    """Files of the project that are neither made by a build nor hidden."""
    tops = [*PACKAGES, "configs", "tests", "docs"]
    found = [p for top in tops if (ROOT / top).is_dir() for p in (ROOT / top).rglob("*")]
    return [p for p in found if p.is_file() and "__pycache__" not in p.parts]


def test_no_room_has_more_than_twelve_files() -> None:
    rooms = Counter(path.parent.relative_to(ROOT) for path in _tracked())
    assert not {str(room): count for room, count in rooms.items() if count > 12}


def test_no_module_has_more_than_400_lines() -> None:
    long = {str(p.relative_to(ROOT)): len(p.read_text().splitlines()) for p in _tracked()
            if p.suffix == ".py"}  # fmt: skip
    assert not {name: lines for name, lines in long.items() if lines > 400}


def test_the_top_has_the_seven_folders_docs_and_few_files() -> None:
    done = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        pytest.skip("no git checkout: which files belong to the project is not known")
    tops = {Path(name).parts[0] for name in done.stdout.splitlines() if "/" in name}
    assert tops - {".ci"} <= {*PACKAGES, "configs", "tests", "docs"}
    files = {name for name in done.stdout.splitlines() if "/" not in name}
    texts = {"LICENSE", "README.md", "CHANGELOG.md"}
    assert files <= texts | {".gitignore", "Makefile", "pyproject.toml", "gonio.py"}


def test_a_room_without_a_place_fails_the_import_contracts(tmp_path: Path) -> None:
    """The contracts are exhaustive: a new module that none of them names is an error."""
    for top in PACKAGES:
        shutil.copytree(ROOT / top, tmp_path / top, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    (tmp_path / "acquisition" / "new_room.py").write_text("")
    linter = Path(sys.executable).with_name("lint-imports")
    done = subprocess.run(
        [linter, "--no-cache"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert "acquisition.new_room" in done.stdout
