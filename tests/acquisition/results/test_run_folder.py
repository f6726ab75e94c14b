"""The folder of a run: its name, its copies of protocol and rig, and what identifies it."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from acquisition.plan.plan import make_plan
from acquisition.results.run_folder import (
    PROTOCOL_FILE,
    RIG_FILE,
    TILE_FILE,
    default_folder,
    load_run_inputs,
    run_meta,
    write_run_inputs,
)
from instrument.config.load import Loaded, load_protocol
from instrument.errors import InputError
from instrument.record.record import Record
from tests.support.paths import CONFIGS
from tests.support.white_tiles import SPECTRALON, table_text


@pytest.fixture
def record(demo: Loaded, tmp_path: Path) -> Iterator[Record]:
    """A new run of the demonstration."""
    with Record.create(tmp_path / "run", run_meta(demo, make_plan(demo))) as record:
        write_run_inputs(record)
        yield record


def test_a_run_keeps_the_texts_of_its_protocol_and_rig(demo: Loaded, record: Record) -> None:
    loaded = load_run_inputs(record)
    assert (loaded.protocol_text, loaded.rig_text) == (demo.protocol_text, demo.rig_text)
    assert (loaded.protocol, loaded.rig) == (demo.protocol, demo.rig)


@pytest.mark.parametrize("name", [PROTOCOL_FILE, RIG_FILE])
def test_a_changed_copy_is_refused(name: str, record: Record) -> None:
    path = record.folder / name
    path.write_text(path.read_text() + "# a remark\n")
    with pytest.raises(InputError, match=f"{name}: changed since the run began, .*restore the"):
        load_run_inputs(record)


def test_a_missing_copy_is_written_again_from_the_record(record: Record) -> None:
    for name in (PROTOCOL_FILE, RIG_FILE):
        (record.folder / name).unlink()
    write_run_inputs(record)
    load_run_inputs(record)


def test_the_record_names_what_the_program_ran_on(demo: Loaded) -> None:
    meta = run_meta(demo, make_plan(demo))
    versions = json.loads(meta["versions"])
    assert set(versions) == {"python", "system", "numpy", "scipy", "opencv-contrib-python-headless"}
    assert "unknown" not in versions.values()
    assert re.fullmatch(r"[0-9a-f]{64}", meta["rig_sha256"])
    assert (meta["hidden"], meta["steps"]) == ("3", "104")


def test_the_default_folder_has_the_protocol_s_name_and_the_time(demo: Loaded) -> None:
    assert re.fullmatch(r"runs/demo-\d{8}-\d{6}", str(default_folder(demo)))


@pytest.fixture
def tabled_run(demo: Loaded, tmp_path: Path) -> Iterator[Record]:
    """A new run of a protocol that names a table of its white tile."""
    text, folder = (CONFIGS / "protocols" / "demo.yaml").read_text(), tmp_path / "here"
    folder.mkdir()
    (folder / "tile.csv").write_text(table_text(SPECTRALON, 0.003, 0.0))
    text = text.replace("reflectance: 0.99, u_reflectance: 0.005", "table: tile.csv")
    (folder / "demo.yaml").write_text(text)
    rig = demo.rig_text.replace("simulation:\n", "simulation:\n  tile: {at_normal: 1.05}\n")
    (folder / "rig.yaml").write_text(rig)
    loaded = load_protocol(folder / "demo.yaml", folder / "rig.yaml")
    with Record.create(tmp_path / "run", run_meta(loaded, make_plan(loaded))) as record:
        write_run_inputs(record)
        shutil.rmtree(folder)
        yield record


def test_a_run_keeps_the_table_of_its_white_tile(tabled_run: Record) -> None:
    """The file that the protocol named is needed no more, nor is the copy."""
    for _ in range(2):
        tile = load_run_inputs(tabled_run).protocol.references.white_tile
        assert tile is not None
        assert tile.values is not None
        assert tile.values.text == table_text(SPECTRALON, 0.003, 0.0)
        (tabled_run.folder / TILE_FILE).unlink()
        write_run_inputs(tabled_run)


def test_a_changed_copy_of_the_table_is_refused(tabled_run: Record) -> None:
    path = tabled_run.folder / TILE_FILE
    path.write_text(path.read_text() + "# a remark\n")
    with pytest.raises(InputError, match=f"{TILE_FILE}: changed since the run began, .*restore"):
        load_run_inputs(tabled_run)
