"""Run folders from strangers: a record runs nothing, breaks nothing and changes no other file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from acquisition.commands.scan import report_run, resume_run
from acquisition.results.sources import Wanted, read_source
from instrument.errors import GonioError, InputError
from instrument.record.record import FILE_NAME
from tests.support.command import gonio
from tests.support.strangers.run_folders import REFUSED, SCRIPT, Sent, copy_of, run_few_points


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sound run: the demo with few view angles."""
    return run_few_points(tmp_path_factory.mktemp("run"))


@pytest.fixture
def sent(run: Path, tmp_path: Path) -> Sent:
    return copy_of(run, tmp_path)


WAYS: dict[str, Callable[[Path], object]] = {
    "report": lambda folder: report_run(folder, as_json=True),
    "resume": lambda folder: resume_run(folder, yes=True, as_json=True),
    "fit": lambda folder: read_source(folder, Wanted(format="run")),
}


@pytest.mark.parametrize("version", [4, 3])
@pytest.mark.parametrize("what", REFUSED)
def test_a_record_that_no_scan_can_have_written_is_refused(
    run: Path, tmp_path: Path, what: str, version: int
) -> None:
    """By every command, before anything is done with it, and no other file is touched."""
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
    """Everything but the database, which SQLite may recover."""
    return {
        path.name: path.read_bytes()
        for path in sent.folder.parent.rglob("*")
        if path.is_file() and not path.name.startswith(FILE_NAME)
    }


def test_the_command_refuses_a_stranger_s_record(sent: Sent) -> None:
    change, words = REFUSED["a view without end in place of meta"]
    change(sent)
    done = gonio("resume", sent.folder, "--yes")
    assert (done.returncode, done.stdout) == (2, "")
    assert words in done.stderr
    assert "Traceback" not in done.stderr


def test_what_cannot_harm_is_shown_as_it_is(sent: Sent) -> None:
    """HTML in captions, pictures and devices; a count of steps that lies; a log left over."""
    sent.sql(
        f"UPDATE preview SET caption = '{SCRIPT}', png = CAST('{SCRIPT}' AS BLOB)",
        f"UPDATE device SET identity = '{SCRIPT}'",
        f"UPDATE meta SET value = '{SCRIPT}' WHERE key = 'program_version'",
        "UPDATE meta SET value = '99999' WHERE key = 'steps'",
    )
    (sent.folder / f"{FILE_NAME}-wal").write_bytes(b"left over" * 999)
    report_run(sent.folder, as_json=True)
    page = (sent.folder / "report.html").read_text()
    assert "<script" not in page.lower()
    assert "&lt;script&gt;" in page
    assert "This picture cannot be read." in page
    assert "of 99999 readings" in page


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
def test_values_that_are_no_measurement_end_with_a_name(sent: Sent, change: str) -> None:
    """In due form, but impossible: whatever comes of it is a result or an error with a name."""
    sent.forge(f"UPDATE reading SET {change}")
    assert _outcome(WAYS["fit"], sent.folder) in ("a result", "NotDetermined")


def test_a_report_of_values_that_are_no_measurement(sent: Sent) -> None:
    sent.sql("UPDATE reading SET u_noise_dn = 0.0, u_quantisation_dn = 0.0, u_texture_dn = 0.0")
    report_run(sent.folder, as_json=True)
    assert "No model was fitted" in (sent.folder / "report.html").read_text()
