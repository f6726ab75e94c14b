"""A run becomes documents, in a file or on a Tiled server, and the same table comes back."""

from __future__ import annotations

import json
import logging
import subprocess
import warnings
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest

from acquisition.facility.documents import run_documents
from acquisition.facility.metadata import READINGS, TABLE
from acquisition.facility.table_columns import columns_of, table_of
from acquisition.facility.tiled_server import fetch_table, send_run
from instrument.errors import InputError, StorageError
from instrument.record.record import Record
from tests.support.command import finished_run
from tests.support.command import gonio_here as gonio
from tests.support.facility.run_engine import events, stops
from tests.support.scans import TWO_MODELS, small_demo

pytest.importorskip("event_model", reason="bluesky is not installed")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("documents")
    return finished_run(small_demo(folder, TWO_MODELS), folder / "run")


def test_a_table_becomes_columns_and_back_byte_for_byte(run: Path) -> None:
    text = (run / "measurements.csv").read_text()
    assert table_of(columns_of(text)) == text
    odd = "flags,frames,brdf,operator,window_pixels\nno brdf,4,,12,100.50\n,5,0.25,,7.00\n"
    assert table_of(columns_of(odd)) == odd
    assert columns_of(odd)["operator"] == ["12", ""]


def test_documents_of_a_record_give_the_table_and_the_readings(run: Path) -> None:
    documents = list(run_documents(run))
    assert [name for name, _ in documents][:2] == ["start", "descriptor"]
    rows = events(documents, TABLE)
    table = table_of({name: [row[name] for row in rows] for name in rows[0]})
    assert table == (run / "measurements.csv").read_text()
    with Record.open(run) as record:
        taken = [reading.signal_dn for reading in record.readings()]
    assert [row["signal_dn"] for row in events(documents, READINGS)] == taken
    assert stops(documents) == ["success"]
    assert documents == list(run_documents(run))


def test_documents_of_a_run_that_is_not_complete_say_what_is_missing(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GONIO_FAULTS", "theta_r stalls at theta_r.wait 12")
    files = run / "protocol.yaml", "--rig", run / "rig.yaml"
    stopped = gonio("run", *files, "--out", tmp_path / "run")
    assert stopped.returncode == 3
    *_, (name, stop) = run_documents(tmp_path / "run")
    assert (name, stop["exit_status"]) == ("stop", "abort")
    assert "the scan is not finished" in stop["reason"]


def test_a_file_has_one_document_a_line(run: Path, tmp_path: Path) -> None:
    path = tmp_path / "run.jsonl"
    done = gonio("export", run, "--format", "documents", "-o", path)
    assert done.returncode == 0, done.stderr
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert [line["name"] for line in lines] == [name for name, _ in run_documents(run)]
    again = gonio("export", run, "--format", "documents", "-o", path)
    assert again.returncode == 2
    assert "exists already" in again.stderr


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["documents", "-o", "run.csv"], "--output must end in .jsonl"),
        (["documents"], "--output: missing: name a file"),
        (["csv", "-o", "a.csv", "--to", "http://127.0.0.1:1"], "--to: for the format csv"),
        (["tiled"], "--to: missing"),
        (["tiled", "-o", "a.csv", "--to", "http://127.0.0.1:1"], "which writes no file"),
        (["document", "-o", "a.csv"], "did you mean documents?"),
    ],
)
def test_wrong_options_are_refused(
    run: Path, tmp_path: Path, arguments: list[str], said: str
) -> None:
    done = gonio("export", run, "--format", *arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert said in done.stderr
    assert not list(tmp_path.iterdir())


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """A Tiled server in this process."""
    pytest.importorskip("tiled.server", reason="Tiled's server is not installed")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the libraries of that server
        from tiled.server import SimpleTiledServer

        with patch("subprocess.run", _tiled_here):
            started = SimpleTiledServer(tmp_path_factory.mktemp("tiled"))
        yield started
        started.close()
        _close_logs()


def _close_logs() -> None:
    """Close the files to which the server's loggers write: it leaves them open.

    Another server in this process would drop them, and Python warn there.
    """
    for name in list(logging.root.manager.loggerDict):
        for handler in list(logging.getLogger(name).handlers):
            if isinstance(handler, logging.FileHandler):
                logging.getLogger(name).removeHandler(handler)
                handler.close()


def _tiled_here(command: list[str], **_: object) -> subprocess.CompletedProcess[bytes]:
    """Run `python -m tiled ...` in this process, which has imported Tiled already."""
    from tiled.commandline.main import cli_app

    assert command[1:3] == ["-m", "tiled"]
    cli_app(command[3:], standalone_mode=False)
    return subprocess.CompletedProcess(command, 0, b"", b"")


@pytest.mark.filterwarnings("ignore")  # of the server's libraries and of its client's
def test_a_run_goes_to_a_tiled_server_and_comes_back_as_the_same_table(
    run: Path, server: Any
) -> None:
    uid = send_run(run, server.uri)
    table = fetch_table(server.uri, uid)
    assert table == (run / "measurements.csv").read_text()
    from tiled.client import from_context, from_uri

    with closing(from_uri(server.uri).context) as context:
        start = from_context(context)[uid].metadata["start"]
    assert start["sample"] == "foam"
    assert start["gonio"]["protocol"] == (run / "protocol.yaml").read_text()
    with pytest.raises(InputError, match=f"holds the run .* already, as {uid}"):
        send_run(run, server.uri)
    with pytest.raises(InputError, match="holds no run nothing") as missing:
        fetch_table(server.uri, "nothing")
    assert server.api_key not in str(missing.value)


@pytest.mark.filterwarnings("ignore")  # of the client's libraries
def test_a_server_that_refuses_is_named_without_its_key(run: Path, server: Any) -> None:
    wrong = "0" * len(server.api_key)
    with pytest.raises(StorageError, match=r"http://127\.0\.0\.1:\d+/api/v1: .*401") as failed:
        send_run(run, server.uri.replace(server.api_key, wrong))
    assert wrong not in str(failed.value)
