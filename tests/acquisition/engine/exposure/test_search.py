"""Search for an exposure: few frames, within the target, whatever the camera makes of it."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from acquisition.engine.exposure.search import MAX_EXPOSURES_TRIED, ExposureSearch
from acquisition.measure.window import window_at
from acquisition.plan.exposure_ladder import exposure_ladder_s
from instrument.devices import Frame
from instrument.pinhole import Pinhole
from tests.support.scans import small_scan

RIG = small_scan().rig
CONFIG = RIG.camera
SPAN = CONFIG.max_dn - CONFIG.black_level_dn
WINDOW = window_at(0.0, Pinhole.of(RIG), 20.0, 20.0)


class Bright:
    """Camera before an even surface that saturates at `full_s`; it may round exposures."""

    def __init__(self, full_s: float, table: list[float] | None) -> None:
        self.full_s, self.table, self.exposure_s, self.taken = full_s, table, 0.0, 0

    def set_exposure_s(self, exposure_s: float) -> float:
        self.exposure_s = exposure_s
        if self.table:
            self.exposure_s = min(self.table, key=lambda known_s: abs(known_s - exposure_s))
        return self.exposure_s

    def grab(self, count: int) -> list[Frame]:
        self.taken += count
        level = CONFIG.black_level_dn + SPAN * self.exposure_s / self.full_s
        shape = (CONFIG.height_px, CONFIG.width_px)
        image = np.full(shape, round(min(level, CONFIG.max_dn)), np.uint16)
        return [Frame(image, self.exposure_s, 0.0)] * count


@given(
    full_s=st.floats(0.005, 10.0), first=st.integers(0, 22),
    table=st.sampled_from([None, [0.0005 * 2**n for n in range(13)]]),
)  # fmt: skip
def test_the_brightest_part_of_the_window_comes_within_the_target(
    full_s: float, first: int, table: list[float] | None
) -> None:
    ladder = exposure_ladder_s(CONFIG)
    camera = Bright(full_s, table)
    search = ExposureSearch(camera, CONFIG, 0.7)
    frames = search.frames(ladder[first], WINDOW)
    assert len(frames) == camera.taken <= MAX_EXPOSURES_TRIED
    share = frames[-1].exposure_s / full_s
    assert share <= 0.701
    longest_s = max(map(Bright(1.0, table).set_exposure_s, ladder))
    if frames[-1].exposure_s < longest_s * 0.99:
        assert share > 0.7 / 2.05 / (2**0.5 if table else 1)
    camera.set_exposure_s(search.asked_s(frames[-1].exposure_s))
    assert camera.exposure_s == frames[-1].exposure_s
