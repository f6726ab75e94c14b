"""Process of the live page: it begins with the scan and ends with it, in whichever way."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from acquisition.live import page_process
from acquisition.live.page_process import live_page, require_libraries
from instrument.errors import InputError
from instrument.record.event_kinds import FINISHED
from tests.support.live.page_client import Browser, ask, with_token
from tests.support.live.runs import begun_run, live_protocol, whole_run
from tests.support.live.scan_side import channel_side
from tests.support.paths import ROOT
from tests.support.timing.deadline import wait_for
from tests.support.whole_scans.stopped_scan import scan

pytestmark = [pytest.mark.waits, pytest.mark.usefixtures("own_folder")]
LONG_S = 240.0


def pages() -> list[int]:
    """Page processes of this process's own."""
    own = Path(f"/proc/self/task/{os.getpid()}/children").read_text()
    return [int(n) for n in own.split() if "acquisition.live" in _command_line(int(n))]


def is_refused(address: str) -> bool:
    parts = urlsplit(address)
    with socket.socket() as line:
        return line.connect_ex((parts.hostname or "", parts.port or 0)) != 0


@pytest.fixture(autouse=True)
def patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """Minutes for a page to end: it yields the processor, and may have a twentieth of one."""
    monkeypatch.setattr(page_process, "_END_S", LONG_S)


def test_a_browser_gets_the_last_point_and_its_model_before_the_page_ends(tmp_path: Path) -> None:
    loaded, run = live_protocol(tmp_path), tmp_path / "run"
    with begun_run(loaded, run) as record, ExitStack() as stack:
        with live_page(run) as address:
            browser = stack.enter_context(Browser(address))
            browser.read_until(lambda one: one.of("progress") is not None)
            assert browser.of("progress")["state"] == "measuring"
            (page,) = pages()
            assert os.getpriority(os.PRIO_PROCESS, page) > os.getpriority(os.PRIO_PROCESS, 0)
            assert address.rpartition("=")[2] not in _command_line(page)
            os.kill(page, signal.SIGINT)  # a Ctrl-C is for the scan
            scan(loaded, record)
            record.add_event("2026-11-28T05:00:00+00:00", FINISHED, "16 steps")
        assert is_refused(address)
        assert pages() == []
        while browser.read_event():
            pass
    assert browser.of("progress")["state"] == "finished"
    assert len(browser.points()) == 16
    assert browser.of("model")["points"] == 10


def _command_line(process: int) -> str:
    return Path(f"/proc/{process}/cmdline").read_text()


@contextmanager
def shown_by_another_program(run: Path) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A program that shows a run and then waits; it and the page's address."""
    script = (
        "import sys, pathlib, time\n"
        "from acquisition.live.page_process import live_page\n"
        "with live_page(pathlib.Path(sys.argv[1])) as address:\n"
        "    print(address, flush=True)\n"
        "    time.sleep(600)\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", script, str(run)], cwd=ROOT, stdout=subprocess.PIPE, text=True
    ) as program:
        assert program.stdout is not None
        try:
            yield program, program.stdout.readline().strip()
        finally:
            program.kill()


def test_the_page_ends_with_a_scan_that_is_killed(tmp_path: Path) -> None:
    """Also with a browser that never reads."""
    run = whole_run(live_protocol(tmp_path), tmp_path / "run")
    with shown_by_another_program(run) as (program, address), Browser(address) as browser:
        browser.read_until(lambda one: one.of("progress") is not None)
        program.kill()
        wait_for(lambda: is_refused(address), "the page's end", LONG_S)


def test_a_camera_is_aimed(tmp_path: Path, own_folder: Path) -> None:
    loaded, channel = live_protocol(tmp_path), own_folder / f"gonio-live-{os.getuid()}" / "aim"
    with channel_side(channel, loaded) as side, live_page(channel, aiming=True) as address:
        side.phase = "aiming"
        with Browser(address) as browser:
            assert browser.last_id is None
            for sharpness, best in ((0.3, 0.3), (0.5, 0.5), (0.2, 0.5)):
                side.show(1000, sharpness=sharpness, best_sharpness=best)
                browser.read_until(
                    lambda one, s=sharpness: (one.of("aim") or {}).get("sharpness") == s
                )
                assert browser.of("aim")["best_sharpness"] == best
            assert browser.of("run")["aiming"]
            assert browser.of("progress")["state"] == "aiming"
            assert browser.of("aim")["peak_dn"] == 1000
            assert ask(address, with_token(address, "/frames/1.jpg")).status == 404


def test_a_taken_port_is_named(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        with pytest.raises(InputError, match=f"--port {port}: .*name another port"):
            live_page(tmp_path, port=port).__enter__()


def test_without_its_libraries_the_page_names_how_to_install_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(page_process, "_LIBRARIES", ("starlette", "no_such_library"))
    with pytest.raises(InputError, match=r"no_such_library.*pip install 'gonio\[live\]'"):
        require_libraries()


def test_a_page_that_fails_says_why_and_hinders_nothing(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    with live_page(tmp_path / "no run"):
        pass
    said = capfd.readouterr().err
    assert said.startswith("the live page had ended early: ")
    assert "no record.sqlite there" in said


def test_a_page_that_is_killed_leaves_the_scan_as_it_is(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    loaded, run = live_protocol(tmp_path), tmp_path / "run"
    with begun_run(loaded, run) as record:
        with live_page(run) as address, Browser(address) as browser:
            browser.read_until(lambda one: one.of("progress") is not None)
            os.kill(*pages(), signal.SIGKILL)
            scan(loaded, record)
        assert len(record.readings()) == 16
    assert "the live page had ended early: " in capfd.readouterr().err
