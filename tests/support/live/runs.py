"""Runs for the live page: a scan of few points with small pictures, as far as a test wants it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from acquisition.plan.plan import make_plan
from acquisition.results.run_folder import run_meta, write_run_inputs
from instrument.config.load import Loaded, load_protocol
from instrument.record.event_kinds import FINISHED
from instrument.record.record import Record
from tests.support.paths import CONFIGS
from tests.support.scans import small_rig
from tests.support.whole_scans.stopped_scan import scan


def live_protocol(
    folder: Path, *, rig: str = "bench_12bit", tile: bool = True, keep_frames: bool = False
) -> Loaded:
    """Two incidences of five views on a rig, with 1/5 of its camera's rows and columns."""
    text = (CONFIGS / "protocols" / "demo.yaml").read_text()
    text = text.replace("[30.0, 45.0, 60.0]", "[30.0, 60.0]").replace("num: 33", "num: 5")
    text = text.replace("../rigs/bench_12bit.yaml", small_rig(folder, rig).name)
    text = text.replace("every_points: 25", "every_points: 4")
    if not tile:
        text = re.sub(r"  white_tile: .*\n", "", text)
    if keep_frames:
        text += "keep_frames: true\n"
    text = text.replace("+torrance_sparrow", "").replace(", ks: 0.076", "")
    text += "fit: {models: [lambert, oren_nayar]}\n"
    (folder / "small.yaml").write_text(text)
    return load_protocol(folder / "small.yaml")


@contextmanager
def begun_run(loaded: Loaded, folder: Path) -> Iterator[Record]:
    """Folder and record of a scan that has begun, locked as a scan does."""
    with (
        Record.create(folder, run_meta(loaded, make_plan(loaded))) as record,
        record.claimed(),
    ):
        write_run_inputs(record)
        yield record


def whole_run(loaded: Loaded, folder: Path) -> Path:
    """A run that has ended."""
    with begun_run(loaded, folder) as record:
        scan(loaded, record)
        record.add_event("2026-11-28T05:00:00+00:00", FINISHED, "all steps")
    return folder
