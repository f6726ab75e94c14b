"""Standard streams: unknown characters replaced, lost and stalled readers ignored."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.cli import main
from acquisition.terminal import streams
from acquisition.terminal.streams import HANDLER, lasting_streams
from tests.support.analysis.no_charts import WITHOUT_CHARTS
from tests.support.command import finished_run, gonio_here, own_signals
from tests.support.paths import ROOT
from tests.support.scans import TWO_MODELS, small_demo


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("finished")
    return finished_run(small_demo(folder, TWO_MODELS), folder / "run")


@given(st.text(), st.sampled_from(["ascii", "latin-1", "cp1252", "koi8-r", "utf-8"]))
def test_any_text_can_be_written_in_any_encoding(text: str, encoding: str) -> None:
    """Characters that the encoding has are unchanged."""
    shown = text.encode(encoding, HANDLER).decode(encoding)
    if text.encode(encoding, "ignore").decode(encoding) == text:
        assert shown == text
    else:
        assert shown.isprintable() or not text.isprintable()


@pytest.mark.parametrize(
    ("text", "encoding", "shown"),
    [
        ("0.80 ± 0.01, θ_i 30°", "ascii", "0.80 +/- 0.01, theta_i 30deg"),
        ("0.80 ± 0.01, θ_i 30°", "latin-1", "0.80 ± 0.01, theta_i 30°"),
        ("4·10⁻⁵ off, χ²/dof 2.1 ⋅ 10¹²", "ascii", "4*10^-5 off, chi^2/dof 2.1 ? 10^12"),
        ("10⁻¹², ½, −3 mm²", "latin-1", "10^-¹², ½, -3 mm²"),
        ("½ Jürgen, Łódź, 反射", "ascii", "? Jurgen, ?odz, ??"),
        ("run\udcff", "utf-8", "run?"),
    ],
)
def test_letters_of_the_field_stay_readable(text: str, encoding: str, shown: str) -> None:
    assert text.encode(encoding, HANDLER).decode(encoding) == shown


@pytest.mark.parametrize("encoding", ["ascii", "latin-1"])
def test_each_command_prints_to_a_terminal_with_few_characters(
    encoding: str, finished: Path
) -> None:
    files = [finished / "protocol.yaml", "--rig", finished / "rig.yaml"]
    for command in ("plan", *files), ("fit", finished / "measurements.csv", "--models", "lambert"):
        done = gonio_here(*command, encoding=encoding)
        assert done.returncode == 0, done.stderr
        assert done.stdout
    assert "+/-" in done.stdout or encoding != "ascii"


LOST = {
    "closed": "os.close(0); os.close(1)",
    "without a reader": "r, w = os.pipe(); os.close(r); os.dup2(w, 1); os.dup2(w, 2)",
}


@pytest.mark.parametrize("lost", list(LOST))
def test_a_fit_whose_output_is_lost_ends_as_it_would_have(lost: str, finished: Path) -> None:
    """The streams are lost before Python starts, as for `gonio report RUN >&-` in a shell."""
    (finished / "report.html").unlink()
    lose = (
        f"import os, sys; {LOST[lost]}; os.execv(sys.executable, [sys.executable, *sys.argv[1:]])"
    )
    done = subprocess.run(
        [sys.executable, "-c", lose, "-c", WITHOUT_CHARTS, "report", finished],
        cwd=ROOT, capture_output=True, check=False, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0
    assert b"Error" not in done.stderr
    assert (finished / "report.html").stat().st_size > 0


@pytest.mark.parametrize("arguments", [["--help"], ["plan"]])
def test_a_full_disk_under_standard_output_is_an_error(
    arguments: list[str], finished: Path, monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    files = [str(finished / "protocol.yaml"), "--rig", str(finished / "rig.yaml")]
    monkeypatch.setattr(sys, "argv", ["gonio", *arguments, *(files if "plan" in arguments else [])])
    with Path("/dev/full").open("w", encoding="utf-8") as full, own_signals():
        monkeypatch.setattr(sys, "stdout", full)
        with pytest.raises(SystemExit) as ended:
            main()
    assert ended.value.code == 3
    assert "standard output: cannot be written: [Errno 28]" in capfd.readouterr().err


def test_text_for_a_stalled_reader_is_dropped_until_it_reads_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(streams, "PATIENCE_S", 0.01)
    reading, writing = os.pipe()
    with (
        os.fdopen(reading, "rb", 0) as reader,
        os.fdopen(writing, "w", encoding="utf-8", closefd=True) as ours,
    ):
        monkeypatch.setattr(sys, "stderr", ours)
        with lasting_streams():
            for _ in range(100):
                sys.stderr.write("x" * 4095 + "\n")  # more than the pipe holds
            held = len(reader.read(1 << 20))
            sys.stderr.write("again\n")
        assert 4096 <= held < 100 * 4096
        assert reader.read(1 << 20) == b"again\n"


@contextmanager
def struck_soon() -> Iterator[None]:
    """Send this thread a SIGINT during the block, however long it is kept from running."""
    main = threading.get_ident()
    strike = threading.Timer(0.2, signal.pthread_kill, (main, signal.SIGINT))
    strike.start()
    try:
        yield
    finally:
        strike.join()


def test_a_wait_for_a_reader_that_was_interrupted_is_not_repeated(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Standard output waits for its reader, a pager; after a Ctrl-C what is left is dropped."""
    reading, writing = os.pipe()
    with os.fdopen(reading, "rb", 0), os.fdopen(writing, "w", encoding="utf-8") as ours:
        monkeypatch.setattr(sys, "stdout", ours)
        with pytest.raises(KeyboardInterrupt), struck_soon(), lasting_streams():
            sys.stdout.writelines("x" * 4095 + "\n" for _ in range(100))


class _Interrupted:
    """Poll object of a reader that never reads; the interrupt came just before the wait began."""

    def register(self, descriptor: int, events: int) -> None: ...

    def poll(self, timeout_ms: float | None = None) -> list[tuple[int, int]]:
        assert timeout_ms is not None, "waits for ever: the interrupt is never seen"
        raise KeyboardInterrupt


def test_an_interrupt_just_before_a_wait_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Python looks for signals between calls, not once the system's wait has begun."""
    reading, writing = os.pipe()
    with os.fdopen(reading, "rb", 0), os.fdopen(writing, "w", encoding="utf-8") as ours:
        monkeypatch.setattr(sys, "stdout", ours)
        monkeypatch.setattr(streams.select, "poll", _Interrupted)
        with pytest.raises(KeyboardInterrupt), lasting_streams():
            sys.stdout.writelines("x" * 4095 + "\n" for _ in range(100))


def test_a_message_after_an_interrupted_one_is_written(monkeypatch: pytest.MonkeyPatch) -> None:
    """A Ctrl-C may come in the midst of a line of progress, and how the scan ended follows it."""
    reading, writing = os.pipe()
    with os.fdopen(reading, "rb") as reader:
        with os.fdopen(writing, "w", encoding="utf-8") as ours:
            monkeypatch.setattr(sys, "stderr", ours)
            with lasting_streams():
                with monkeypatch.context() as once:
                    once.setattr(streams.select, "poll", _Interrupted)
                    with pytest.raises(KeyboardInterrupt):
                        sys.stderr.write("5/21\n")
                sys.stderr.write("stopped\n")
        assert reader.read().endswith(b"stopped\n")
