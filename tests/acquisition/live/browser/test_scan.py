"""A scan in real time in the browser: watched, paused, resumed, aborted, and resumed again."""

from __future__ import annotations

import re
import shutil
import sqlite3
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from instrument.record.record import Record
from tests.support.live.chromium import Windows, missing
from tests.support.live.live_scan import DEADLINE_S, live_command
from tests.support.scans import TWO_MODELS, small_demo
from tests.support.timing.deadline import wait_for
from tests.support.whole_scans.simulated_rig import quick_emulated_rig

if TYPE_CHECKING:
    from playwright.sync_api import Page

if missing():
    pytest.skip(missing(), allow_module_level=True)
else:
    from playwright.sync_api import expect

pytestmark = [
    pytest.mark.long,
    pytest.mark.real_time,
    pytest.mark.skipif(
        shutil.which("cc") is None, reason="the emulated camera needs a C compiler (cc)"
    ),
]


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    """The emulated rig, in real time; it settles, so that a page shows points one by one."""
    path = tmp_path / "rig.yaml"
    fewer_frames = quick_emulated_rig().replace("frames_per_s: 400", "frames_per_s: 100")
    before, axis, theta_r = fewer_frames.partition("theta_r:")
    path.write_text(before + axis + theta_r.replace("settle_s: 0.0", "settle_s: 1.5"))
    return path


@pytest.fixture
def protocol(tmp_path: Path) -> Path:
    """The small demonstration with more points than a scan measures while a browser starts."""
    path = small_demo(tmp_path, TWO_MODELS)
    path.write_text(path.read_text().replace("num: 9", "num: 61"))
    return path


def readings(run: Path) -> int:
    with sqlite3.connect(f"file:{run / 'record.sqlite'}?mode=ro", uri=True) as record:
        return int(record.execute("SELECT COUNT(*) FROM reading").fetchone()[0])


def steps(run: Path) -> list[int]:
    """Return the steps of all readings, in the order of the record."""
    with Record.open(run) as record:
        return [reading.step for reading in record.rows().readings]


def points_shown(page: Page) -> int:
    found = re.match(r"(\d+) of", page.locator("#chart-note").inner_text())
    return int(found[1]) if found else 0


def test_a_scan_is_paused_resumed_and_aborted_on_the_page(
    windows: Windows, tmp_path: Path, protocol: Path, rig: Path
) -> None:
    run = tmp_path / "run"
    arguments = ("run", protocol, "--rig", rig, "--out", run, "--live")
    with live_command(tmp_path / "said", *arguments) as scan:
        page = windows.open(scan.address)
        state, note = page.locator("#state-name"), page.locator("#chart-note")
        expect(note).to_contain_text(re.compile(r"^[1-9]\d* of 118 points"))
        page.keyboard.press("p")
        expect(state).to_have_text("Paused")
        paused_at = readings(run)
        second = windows.open(scan.address)
        expect(second.locator("#state-name")).to_have_text("Paused")
        assert readings(run) == paused_at
        for part in ("chart-note", "done"):
            expect(second.locator(f"#{part}")).to_have_text(page.locator(f"#{part}").inner_text())
        before = points_shown(page)
        second.get_by_role("button", name="Resume").click()
        expect(state).to_have_text("Measuring")
        expect(note).not_to_contain_text(f"{before} of")
        page.get_by_role("button", name="Abort…").click()
        page.get_by_role("button", name="Abort the scan").click()
        assert scan.exit_code() == 4
        expect(state).to_have_text("Stopped")
        expect(page.locator("#buttons button:visible")).to_have_count(0)
        expect(page.locator("#state-text")).to_contain_text(f"gonio resume {run}")
        assert "all motion has ended" in re.sub(r"\s+", " ", scan.said)
        page.close()
        second.close()
    windows.complaints = [c for c in windows.complaints if "ERR_" not in c]  # the page has ended
    measured = steps(run)
    assert len(measured) > paused_at
    with live_command(tmp_path / "said_again", "resume", run, "--yes", "--live") as resumed:
        wait_for(lambda: readings(run) > len(measured), "another reading", DEADLINE_S)
        resumed.process.terminate()
        assert resumed.exit_code() == 4
    assert steps(run)[: len(measured)] == measured
    assert len(set(steps(run))) == len(steps(run)) > len(measured)


def test_the_lens_is_aimed_with_the_emulated_camera(
    windows: Windows, tmp_path: Path, rig: Path
) -> None:
    with live_command(tmp_path / "said", "grab", "--rig", rig, "--live") as grab:
        page = windows.open(grab.address)
        expect(page.locator("#state-name")).to_have_text("Aiming")
        expect(page.locator("#aim")).to_contain_text("% of the best")
        expect(page.locator("#picture-legend")).to_be_visible()
        page.close()
