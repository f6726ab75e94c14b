"""A run that has ended in the browser: what a user finds on the page and nowhere else."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml

from instrument.config.load import load_protocol
from tests.support.live.chromium import Windows, missing
from tests.support.live.pages import served
from tests.support.live.runs import live_protocol, whole_run

if missing():
    pytest.skip(missing(), allow_module_level=True)
else:
    from playwright.sync_api import expect


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A glossy sample at 30° incidence: at θᵣ −40°, near its mirror direction, too bright."""
    live_protocol(tmp_path, keep_frames=True)
    rig, protocol = tmp_path / "small_rig.yaml", tmp_path / "small.yaml"
    rig.write_text(re.sub(r"min_exposure_s: \S+", "min_exposure_s: 0.012", rig.read_text()))
    wanted = yaml.safe_load(protocol.read_text())
    wanted["sweeps"][0]["theta_i_deg"] = [30.0]
    wanted["simulated_sample"]["model"] = "oren_nayar+torrance_sparrow"
    wanted["simulated_sample"]["parameters"] = {"albedo": 0.8, "sigma_deg": 6.0, "ks": 0.5}
    protocol.write_text(yaml.safe_dump(wanted))
    return whole_run(load_protocol(protocol), tmp_path / "run")


def test_the_page_alone_tells_which_point_is_saturated(windows: Windows, run: Path) -> None:
    with served(run) as address:
        page = windows.open(address)
        expect(page.locator("#state-name")).to_have_text("Finished")
        expect(page.locator("#buttons button:visible")).to_have_count(0)
        entry = page.locator("#attention-list li")
        expect(entry).to_have_count(1)
        expect(entry).to_contain_text("θᵢ 30°, θᵣ −40° saturated: ")
        expect(entry).to_contain_text(
            "pixels of 4 frames at full scale (brightest part 4095 of 4095 DN)"
        )
        entry.get_by_role("button").click()
        frame = page.locator("#selected-frame")
        expect(frame).to_be_visible()
        expect(frame).to_have_js_property("complete", True)
        # The frame's saturated pixels are red: in its middle, where the window is.
        red, green = frame.evaluate(
            """image => {
                const canvas = document.createElement('canvas');
                const context = canvas.getContext('2d');
                [canvas.width, canvas.height] = [image.naturalWidth, image.naturalHeight];
                context.drawImage(image, 0, 0);
                const [x, y] = [canvas.width / 2, canvas.height / 2];
                return [...context.getImageData(x, y, 1, 1).data.slice(0, 2)];
            }"""
        )
        assert red > 3 * green
        page.close()
