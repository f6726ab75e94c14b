"""A scan in real time in the browser: watched, paused, resumed, aborted, and resumed again."""

from __future__ import annotations

import json
import re
import shutil
import sqlite3
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from acquisition.live import channel
from instrument.record.record import Record
from tests.support.command import gonio
from tests.support.live.chromium import Windows, missing
from tests.support.live.live_scan import channel_of_scan, live_command
from tests.support.scans import TWO_MODELS, small_demo
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
    """The emulated rig, in real time, that settles so long that a busy browser can keep up."""
    path = tmp_path / "rig.yaml"
    fewer_frames = quick_emulated_rig().replace("frames_per_s: 400", "frames_per_s: 100")
    before, axis, theta_r = fewer_frames.partition("theta_r:")
    path.write_text(before + axis + theta_r.replace("settle_s: 0.0", "settle_s: 1.5"))
    return path


@pytest.fixture
def protocol(tmp_path: Path) -> Path:
    """The small demonstration, shorter still, with models that are fitted quickly."""
    path = small_demo(tmp_path, TWO_MODELS)
    path.write_text(path.read_text().replace("num: 9", "num: 7"))
    return path


def readings(run: Path) -> int:
    with sqlite3.connect(f"file:{run / 'record.sqlite'}?mode=ro", uri=True) as record:
        return int(record.execute("SELECT COUNT(*) FROM reading").fetchone()[0])


def points_shown(page: Page) -> int:
    found = re.match(r"(\d+) of", page.locator("#chart-note").inner_text())
    return int(found[1]) if found else 0


def test_a_scan_is_paused_resumed_and_aborted_on_the_page(
    windows: Windows, tmp_path: Path, protocol: Path, rig: Path
) -> None:
    """It is held from outside while the browser starts, which may last longer than the scan."""
    run = tmp_path / "run"
    arguments = ("run", protocol, "--rig", rig, "--out", run, "--live")
    with live_command(tmp_path / "said", *arguments) as scan:
        assert channel.send(channel_of_scan(run), channel.PAUSE) == channel.OK
        page = windows.open(scan.address)
        state, note = page.locator("#state-name"), page.locator("#chart-note")
        expect(state).to_have_text("Paused")
        page.keyboard.press("p")
        expect(note).to_contain_text(re.compile(r"^[1-9]\d* of 14 points"))
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
    with Record.open(run) as record:
        planned = int(record.meta("steps") or 0)
    assert paused_at < readings(run) < planned
    done = gonio("resume", run, "--yes", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["verdict"] == "adequate"
    with Record.open(run) as record:
        assert sum(r.kind == "point" for r in record.rows().readings) == 14


def test_the_lens_is_aimed_with_the_emulated_camera(
    windows: Windows, tmp_path: Path, rig: Path
) -> None:
    with live_command(tmp_path / "said", "grab", "--rig", rig, "--live") as grab:
        page = windows.open(grab.address)
        expect(page.locator("#state-name")).to_have_text("Aiming")
        expect(page.locator("#aim")).to_contain_text("% of the best")
        expect(page.locator("#picture-legend")).to_be_visible()
        page.close()
