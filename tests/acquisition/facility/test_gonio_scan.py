"""A protocol under bluesky's run engine gives the values of `gonio run`, whatever interrupts it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from acquisition.commands.scan import scan_into
from acquisition.facility.documents import run_documents
from acquisition.facility.metadata import READINGS, TABLE
from acquisition.facility.plans import gonio_scan
from acquisition.facility.table_columns import columns_of, table_of
from acquisition.results.finish import finish
from acquisition.results.run_folder import load_run_inputs
from instrument.config.load import load_protocol
from instrument.errors import InputError
from instrument.record.record import Record
from sim.scene.camera import SimulatedCamera
from tests.support.facility.run_engine import (
    DEADLINE_S,
    Documents,
    HeldMoves,
    begun_in_thread,
    engine_and_documents,
    events,
    paused_after,
    stops,
)
from tests.support.paths import CONFIGS
from tests.support.scans import TWO_MODELS, small_demo, undated

pytest.importorskip("bluesky", reason="bluesky is not installed")
from bluesky.utils import FailedStatus, RunEngineInterrupted


@pytest.fixture(scope="module")
def protocol(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return small_demo(tmp_path_factory.mktemp("facility"), TWO_MODELS)


@pytest.fixture(scope="module")
def by_command(protocol: Path) -> Path:
    """The same protocol measured as `gonio run` does."""
    return scan_into(load_protocol(protocol), protocol.parent / "command", finish)


def columns(run: Path) -> dict[str, Any]:
    """Columns of a run's table, without the date."""
    found = columns_of((run / "measurements.csv").read_text())
    found.pop("time_utc")
    return found


def readings(run: Path) -> list[Any]:
    with Record.open(run) as record:
        load_run_inputs(record)
        return undated(record.readings())


@pytest.fixture(scope="module")
def scanned(protocol: Path) -> tuple[Path, Documents]:
    """The folder and the documents of one scan under a run engine."""
    engine, documents = engine_and_documents()
    folder = protocol.parent / "scanned"
    result = engine(gonio_scan(protocol, out=folder, md={"proposal": "24-1"}))
    assert result.plan_result == str(folder)
    return folder, documents


def test_a_scan_gives_the_record_the_table_and_the_fit_of_the_command(
    scanned: tuple[Path, Documents], by_command: Path
) -> None:
    run, _ = scanned
    assert readings(run) == readings(by_command)
    assert columns(run) == columns(by_command)
    fits = [json.loads((folder / "fit.json").read_text()) for folder in (run, by_command)]
    assert fits[0] == fits[1]
    with Record.open(run) as record:
        assert [kind for _, kind, _ in record.events()][-1] == "finished"


def test_the_documents_give_the_same_table(scanned: tuple[Path, Documents], protocol: Path) -> None:
    run, documents = scanned
    rows = events(documents, TABLE)
    table = table_of({name: [row[name] for row in rows] for name in rows[0]})
    assert table == (run / "measurements.csv").read_text()
    assert len(events(documents, READINGS)) == len(readings(run))
    assert stops(documents) == ["success"]
    start = documents[0][1]
    assert (start["sample"], start["rig"], start["proposal"]) == ("foam", "bench_12bit", "24-1")
    assert start["gonio"]["protocol"] == protocol.read_text()


def test_documents_made_from_the_record_describe_the_same_values(
    scanned: tuple[Path, Documents],
) -> None:
    run, documents = scanned
    emitted, made = (_descriptors(found) for found in (documents, list(run_documents(run))))
    for stream in (READINGS, TABLE):
        keys = made[stream]["data_keys"]
        assert list(keys) == list(emitted[stream]["data_keys"])
        for name, key in emitted[stream]["data_keys"].items():
            assert keys[name] == {k: v for k, v in key.items() if k != "object_name"}
    own, other = (found[READINGS]["configuration"]["scan"] for found in (made, emitted))
    assert own["data"]
    assert (own["data"], own["data_keys"]) == (other["data"], other["data_keys"])


def _descriptors(documents: Documents) -> dict[str, dict[str, Any]]:
    return {d["name"]: d for n, d in documents if n == "descriptor"}


def test_every_number_of_an_event_has_a_unit_where_it_has_one(
    scanned: tuple[Path, Documents],
) -> None:
    keys = {d["name"]: d["data_keys"] for n, d in scanned[1] if n == "descriptor"}
    assert keys[READINGS]["theta_r_deg"]["units"] == "deg"
    assert keys[READINGS]["signal_dn"]["units"] == "DN"
    assert keys[READINGS]["exposure_s"]["units"] == "s"
    assert keys[TABLE]["brdf"]["units"] == keys[TABLE]["u_brdf"]["units"] == "1/sr"
    bare = {n for k in keys.values() for n, key in k.items() if "units" not in key}
    counts = {"step", "lamp_setting", "block", "frames"}
    texts = {"kind", "surface", "flags", "time_utc"}
    assert {name for name in bare if not name.startswith("group_")} == counts | texts


def test_a_pause_on_the_way_is_followed_by_a_drift_check_and_the_same_points(
    protocol: Path, by_command: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    engine, documents = engine_and_documents()
    held = HeldMoves(monkeypatch, "theta_r")
    held.held = False
    grab = SimulatedCamera.grab

    def grab_then_hold(camera: SimulatedCamera, count: int) -> Any:
        held.held = len(events(documents, READINGS)) == 6 and not held.begun.is_set()
        return grab(camera, count)

    monkeypatch.setattr(SimulatedCamera, "grab", grab_then_hold)

    def pause_once_moving() -> None:
        assert held.begun.wait(DEADLINE_S)
        engine.request_pause()

    with begun_in_thread(pause_once_moving), pytest.raises(RunEngineInterrupted):
        engine(gonio_scan(protocol, out=tmp_path / "run"))
    assert held.stopped.is_set()
    held.held = False
    engine.resume()
    assert stops(documents) == ["success"]
    run = tmp_path / "run"
    angles = ("theta_i_deg", "theta_r_deg", "dphi_deg")
    assert all(columns(run)[name] == columns(by_command)[name] for name in angles)
    assert columns(run)["brdf"] == pytest.approx(columns(by_command)["brdf"], rel=1e-3)
    with Record.open(run) as record:
        kinds = [kind for _, kind, _ in record.events()]
        said = [text for _, kind, text in record.events() if kind == "operator"]
    assert "drift" in kinds
    assert [text for text in said if "run engine" in text] == [
        "paused by the run engine",
        "continued by the run engine",
    ]


def test_an_abort_leaves_a_record_that_resumes(
    protocol: Path, by_command: Path, tmp_path: Path
) -> None:
    from acquisition.commands.scan import resume_run

    engine, documents = engine_and_documents()
    run = tmp_path / "run"
    with pytest.raises(RunEngineInterrupted):
        engine(paused_after(gonio_scan(protocol, out=run), 5))
    engine.abort("enough")
    assert stops(documents) == ["abort"]
    with Record.open(run) as record:
        assert [text for _, kind, text in record.events() if kind == "stopped"] == [
            "stopped by the run engine"
        ]
    resume_run(run, yes=True, as_json=False)
    assert columns(run)["theta_r_deg"] == columns(by_command)["theta_r_deg"]


def test_a_fault_names_the_command_that_resumes(
    protocol: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GONIO_FAULTS", "theta_r stalls at theta_r.wait 5")
    engine, documents = engine_and_documents()
    run = tmp_path / "run"
    with pytest.raises(FailedStatus) as failed:
        engine(gonio_scan(protocol, out=run))
    assert f"Go on with: gonio resume {run}" in str(failed.value.__cause__)
    assert stops(documents) == ["fail"]
    with Record.open(run) as record:
        assert [kind for _, kind, _ in record.events()][-1] == "fault"


@pytest.mark.parametrize(("key", "value"), [("goal", "{sigma_deg: {u: 0.2}}"), ("motion", "fly")])
def test_a_scan_that_no_run_engine_can_lead_is_refused(
    protocol: Path, tmp_path: Path, key: str, value: str
) -> None:
    path = tmp_path / "other.yaml"
    path.write_text(f"{protocol.read_text()}{key}: {value}\n")
    engine, documents = engine_and_documents()
    with pytest.raises(InputError, match=f"{key}: a run engine visits planned"):
        engine(gonio_scan(path, out=tmp_path / "run"))
    assert not documents
    assert not (tmp_path / "run").exists()


def test_a_folder_in_use_is_refused_before_anything_moves(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("keep")
    engine, documents = engine_and_documents()
    with pytest.raises(FailedStatus) as failed:
        engine(gonio_scan(CONFIGS / "protocols" / "demo.yaml", out=tmp_path))
    assert isinstance(failed.value.__cause__, InputError)
    assert not documents
