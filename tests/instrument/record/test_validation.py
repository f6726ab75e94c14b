"""A stranger's run is data: its record runs nothing, breaks nothing, and reaches no other file."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

import pytest

from acquisition.commands.scan import report_run, resume_run
from acquisition.results.sources import Wanted, read_source
from instrument.errors import GonioError, InputError
from instrument.record.record import FILE_NAME, Record
from tests.support.command import gonio
from tests.support.paths import CONFIGS
from tests.support.strangers.mutations import Mutator, feed
from tests.support.strangers.run_folders import REFUSED, SCRIPT, Sent, copy_of


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sound run: the demo with few view angles."""
    folder = tmp_path_factory.mktemp("run")
    text = (CONFIGS / "protocols" / "demo.yaml").read_text().replace("num: 33", "num: 5")
    protocol = folder / "few.yaml"
    protocol.write_text(text.replace("../rigs/", f"{CONFIGS / 'rigs'}/"))
    done = gonio("run", protocol, "--out", folder / "run")
    assert done.returncode == 0, done.stderr
    return folder / "run"


@pytest.fixture
def sent(run: Path, tmp_path: Path) -> Sent:
    return copy_of(run, tmp_path)


WAYS: dict[str, Callable[[Path], object]] = {
    "report": lambda folder: report_run(folder, as_json=True),
    "resume": lambda folder: resume_run(folder, yes=True, as_json=True),
    "fit": lambda folder: read_source(folder, Wanted(format="run")),
}


@pytest.mark.parametrize("what", REFUSED)
def test_a_record_that_no_scan_can_have_written_is_refused(sent: Sent, what: str) -> None:
    """By every command, before anything is done with it, and no other file is touched."""
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


def test_a_picture_too_large_is_refused(sent: Sent, monkeypatch: pytest.MonkeyPatch) -> None:
    """The limits themselves are hundreds of MB; here they are smaller, so that less is written."""
    monkeypatch.setattr("instrument.record.validation._PICTURES", (9_000_000, 1_000_000))
    sent.sql("UPDATE preview SET png = zeroblob(2000000)")
    with pytest.raises(InputError, match="pictures of 2000000 bytes; allowed: 1000000"):
        Record.open(sent.folder)


def test_more_than_can_be_reduced_is_refused(sent: Sent, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("instrument.record.validation.MOST_WORK", 10)
    with pytest.raises(InputError, match=r"readings, .* are too many"):
        Record.open(sent.folder)


@pytest.mark.slow
def test_any_damage_to_a_record_gives_a_result_or_an_input_error(sent: Sent, slow: bool) -> None:
    """Whatever is read of a record at all is read here."""

    def read(data: bytes) -> None:
        for name in ("", "-wal", "-shm"):
            (sent.folder / f"{FILE_NAME}{name}").unlink(missing_ok=True)
        sent.record.write_bytes(data)
        said = str(sent.folder)
        try:
            with Record.open(sent.folder) as record:
                contents = (record.readings(), record.previews(), record.devices(), record.darks())
                assert all(part is not None for part in contents)
        except InputError as error:
            said = str(error)
        assert said.startswith(str(sent.folder))

    whole = sent.record.read_bytes()
    spoilt = Mutator([whole], 7)

    def spoil(number: int) -> bytes:
        """Bytes damaged here and there, which leaves most of the file whole, or anything."""
        rng = random.Random(number)
        if number % 4 == 0:
            return spoilt(number)
        data = bytearray(whole)
        for _ in range(rng.randint(1, 30)):
            at = rng.randrange(len(data) if number % 2 else 100)
            data[at] = rng.randrange(256)
        return bytes(data)

    feed(spoil, 1000 if slow else 30, read)


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
    sent.sql(f"UPDATE reading SET {change}")
    assert _outcome(WAYS["fit"], sent.folder) in ("a result", "NotDetermined")


def test_a_report_of_values_that_are_no_measurement(sent: Sent) -> None:
    sent.sql("UPDATE reading SET u_noise_dn = 0.0, u_quantisation_dn = 0.0, u_texture_dn = 0.0")
    report_run(sent.folder, as_json=True)
    assert "No model was fitted" in (sent.folder / "report.html").read_text()
