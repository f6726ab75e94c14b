"""Run folders from elsewhere: a record runs no code, breaks nothing, and changes no other file."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from acquisition.commands.scan import report_run, resume_run
from acquisition.live.following.board import Board
from acquisition.live.following.run_follower import RunFollower
from acquisition.live.following.run_reader import RunReader
from acquisition.results.sources import Wanted, read_source
from instrument.errors import GonioError, InputError, NotDetermined
from instrument.record.record import FILE_NAME
from instrument.record.schema import SCHEMA_VERSION
from tests.support.command import gonio_here as gonio
from tests.support.strangers.run_folders import REFUSED, SCRIPT, Sent, copy_of, run_few_points


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A valid run: the demo with few view angles."""
    return run_few_points(tmp_path_factory.mktemp("run"))


@pytest.fixture
def sent(run: Path, tmp_path: Path) -> Sent:
    return copy_of(run, tmp_path)


def shown(folder: Path) -> list[Any]:
    """Return what the live page of a run shows, without the model."""
    board = Board()
    with RunReader(folder) as reader, RunFollower(reader, board) as follower:
        follower.poll()
        return [m.data for m in board.after(0, 10**9) if m.kind != "model"]


WAYS: dict[str, Callable[[Path], object]] = {
    "report": lambda folder: report_run(folder, as_json=True),
    "resume": lambda folder: resume_run(folder, yes=True, as_json=True),
    "fit": lambda folder: read_source(folder, Wanted(format="run")),
    "watch": shown,
}


# `Record.open` refuses each in every version: see `test_validation`. The commands that call it need
# no more than the newest, and one of the three older ones in turn.
CASES = [(what, v) for n, what in enumerate(REFUSED) for v in (SCHEMA_VERSION, 3 + n % 3)]


@pytest.mark.parametrize(("what", "version"), CASES)
def test_every_command_refuses_a_record_that_no_scan_wrote(
    run: Path, tmp_path: Path, what: str, version: int
) -> None:
    """Before it does anything else; no other file is changed."""
    sent = copy_of(run, tmp_path, version)
    change, words = REFUSED[what]
    change(sent)
    before = _others(sent)
    for way in WAYS.values():
        with pytest.raises(InputError) as refused:
            way(sent.folder)
        assert words in str(refused.value)
        assert str(sent.folder) in str(refused.value)
    assert _others(sent) == before
    assert sent.victim.read_text() == "my own\n"


def _others(sent: Sent) -> dict[str, bytes]:
    """Return all files except the database, which SQLite may recover."""
    return {
        path.name: path.read_bytes()
        for path in sent.folder.parent.rglob("*")
        if path.is_file() and not path.name.startswith(FILE_NAME)
    }


def test_the_exit_code_for_a_refused_record_is_2(sent: Sent) -> None:
    change, words = REFUSED["a view without end in place of meta"]
    change(sent)
    done = gonio("resume", sent.folder, "--yes")
    assert (done.returncode, done.stdout) == (2, "")
    assert words in done.stderr
    assert "Traceback" not in done.stderr


def test_harmless_contents_are_shown_as_text(sent: Sent) -> None:
    """HTML in captions, pictures and devices; a wrong count of steps; a leftover log."""
    sent.sql(
        f"UPDATE preview SET caption = '{SCRIPT}', png = CAST('{SCRIPT}' AS BLOB)",
        f"UPDATE device SET identity = '{SCRIPT}'",
        f"UPDATE meta SET value = '{SCRIPT}' WHERE key = 'program_version'",
        "UPDATE meta SET value = '99999' WHERE key = 'steps'",
    )
    (sent.folder / f"{FILE_NAME}-wal").write_bytes(b"left over" * 999)
    report_run(sent.folder, as_json=True)
    page = (sent.folder / "report.html").read_text()
    # The values of the points, which no browser runs, and the program's own script.
    ours = ['<script type="application/json" id="points">', "<script>"]
    assert re.findall(r"<script[^>]*>", page, re.IGNORECASE) == ours
    assert "&lt;script&gt;" in page
    assert "This picture cannot be read." in page
    assert "of 99999 readings" in page


def test_the_live_page_of_hostile_texts_is_one_of_texts(sent: Sent) -> None:
    """JSON carries them: the page's script writes them as text, see `test_page`."""
    hostile = f"{SCRIPT}\n\nevent: run\ndata: \x1b[2J"
    sent.sql(f"UPDATE event SET text = '{hostile}'")
    events = [data for data in shown(sent.folder) if data and {"kind", "text"} <= data.keys()]
    texts = [event["text"] for event in events]
    assert texts
    assert all(text.startswith(SCRIPT) and "\x1b" not in text for text in texts)


def test_results_replace_links_and_do_not_follow_them(sent: Sent) -> None:
    names = ("measurements.csv", "fit.json", "report.html")
    for name in names:
        sent.link(name)
    report_run(sent.folder, as_json=True)
    assert sent.victim.read_text() == "my own\n"
    assert not any((sent.folder / name).is_symlink() for name in names)


def _outcome(way: Callable[[Path], object], folder: Path) -> str:
    try:
        way(folder)
    except GonioError as error:
        return type(error).__name__
    return "a result"


@pytest.mark.parametrize(
    "change", ["u_noise_dn = 0.0", "signal_dn = 1e30", "signal_dn = -1e-30", "time_s = -step"]
)
def test_impossible_but_well_formed_values_give_a_result_or_a_named_error(
    sent: Sent, change: str
) -> None:
    sent.forge(f"UPDATE reading SET {change}")
    named = ("a result", "NotDetermined", "AllFlagged")
    assert _outcome(WAYS["fit"], sent.folder) in named
    assert shown(sent.folder)[-1]["state"] in ("finished", "lost")


def test_a_report_of_impossible_values_says_that_nothing_was_fitted(sent: Sent) -> None:
    sent.sql("UPDATE reading SET u_noise_dn = 0.0, u_quantisation_dn = 0.0, u_texture_dn = 0.0")
    with pytest.raises(NotDetermined, match=r"the run is complete: .* u_random = 0 1/sr"):
        report_run(sent.folder, as_json=True)
    assert "No model was fitted" in (sent.folder / "report.html").read_text()
