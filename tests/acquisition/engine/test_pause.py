"""Pause: it costs no reading, changes none, and is told from what the lamp did meanwhile."""

from __future__ import annotations

import random
import threading
from dataclasses import replace
from pathlib import Path

import pytest

from acquisition.engine.engine import Devices, Engine
from acquisition.engine.onlookers import Present
from acquisition.engine.pause import PauseSwitch
from acquisition.plan.plan import Step, make_plan
from acquisition.results.reduction import reduce
from acquisition.rig import open_devices
from instrument.config.load import Loaded
from instrument.record.event_kinds import DRIFT, OPERATOR
from instrument.record.reading import Reading
from instrument.record.record import Record
from tests.support.scans import undated
from tests.support.stand_ins import PassThrough
from tests.support.whole_scans.stopped_scan import stops


class PausedScan:
    """Scan that is paused after the steps `after`, and goes on at once; `seen`: its states then."""

    def __init__(
        self, loaded: Loaded, record: Record, after: set[int], devices: Devices | None = None
    ) -> None:
        self.devices = devices or open_devices(loaded)
        self.seen: list[Present] = []
        self._after, self._switch = after, PauseSwitch(self._said)
        self._plan = make_plan(loaded)
        self._engine = Engine(
            loaded.protocol, loaded.rig, self.devices, record, self._on_step, pause=self._switch
        )

    def run(self) -> None:
        if -1 in self._after:
            self._switch.turn(on=True, by="before the scan")
        self._engine.run(self._plan)

    def on_pause(self) -> None:
        """Called while the scan stands."""

    def _on_step(self, step: Step) -> None:
        if step.index in self._after:
            self._after.discard(step.index)
            self._switch.turn(on=True, by="in a test")

    def _said(self, text: str) -> None:
        if text.startswith("paused"):
            self.seen.append(self._engine.present())
            self.on_pause()
            self._switch.turn(on=False, by="in a test")


@pytest.mark.slow
def test_paused_after_any_step_the_rest_is_the_same_to_the_last_digit(
    small: Loaded, whole: list[Reading], tmp_path: Path, slow: bool
) -> None:
    for step in (-1, *stops(whole, slow)):
        with Record.create(tmp_path / str(step), {}) as record:
            PausedScan(small, record, {step}).run()
            assert undated(record.readings()) == whole
            assert not any(check.jumped for check in record.checks())


@pytest.mark.slow
def test_paused_again_and_again_the_rest_is_the_same(
    small: Loaded, whole: list[Reading], tmp_path: Path, slow: bool
) -> None:
    chosen = random.Random(20)
    for number in range(4 if slow else 2):
        after = {step for step in range(-1, len(whole) - 1) if chosen.random() < 0.4}
        with Record.create(tmp_path / str(number), {}) as record:
            scan = PausedScan(small, record, set(after))
            scan.run()
            assert undated(record.readings()) == whole
            events = [text for _, kind, text in record.events() if kind == OPERATOR]
        paused = sum(text.startswith("paused") for text in events)
        assert 0 < paused == len(scan.seen) <= len(after)  # none after the last frames


def test_a_pause_keeps_on_record_where_the_axes_stood_and_what_the_lamp_did(
    small: Loaded, whole: list[Reading], record: Record
) -> None:
    step = next(r for r in whole if r.kind == "point" and r.theta_r_deg == 35.0)
    scan = PausedScan(small, record, {step.step})
    scan.run()
    (present,) = scan.seen
    assert (present.phase, present.lamp, present.moving) == ("paused", "lit", "")
    texts = [text for _, kind, text in record.events() if kind == OPERATOR]
    paused = next(n for n, text in enumerate(texts) if text.startswith("paused in a test"))
    # The scan looks at the switch once the next geometry is exposed at the latest.
    assert "theta_i 30, dphi 0, theta_r " in texts[paused]
    assert texts[paused].endswith("the lamp is lit")
    assert texts[paused + 1] == "continued in a test after 0 s"
    drift = [text for _, kind, text in record.events() if kind == DRIFT]
    assert len(drift) == len(record.checks()) == 1


def test_a_lamp_that_changed_during_a_pause_is_found_and_followed(
    small: Loaded, whole: list[Reading], record: Record
) -> None:
    """It is 20 % darker afterwards: the BRDF stays what it was, as after a stop and a resume."""

    class Dimmed(PassThrough):
        share = 1.0

        def grab(self, count: int) -> list[object]:
            frames = self._device.grab(count)  # type: ignore[attr-defined]  # a camera
            black = small.rig.camera.black_level_dn
            return [
                replace(f, image=(black + self.share * (f.image - black)).astype(f.image.dtype))
                for f in frames
            ]

    devices = open_devices(small)
    camera = Dimmed(devices.camera)
    scan = PausedScan(small, record, {8}, replace(devices, camera=camera))  # type: ignore[arg-type]  # a stand-in
    scan.on_pause = lambda: setattr(camera, "share", 0.8)  # type: ignore[method-assign]  # of one scan
    scan.run()
    (check,) = record.checks()
    assert check.jumped
    found = reduce(record.readings(), small.protocol, record.checks()).brdf
    assert found == pytest.approx(reduce(whole, small.protocol, ()).brdf, rel=5e-3)


def test_an_onlooker_in_another_thread_sees_the_scan_move_expose_and_end(
    small: Loaded, record: Record
) -> None:
    seen: set[tuple[str, bool]] = set()
    over = threading.Event()
    engine = Engine(small.protocol, small.rig, open_devices(small), record, lambda _: None)

    def watch() -> None:
        while not over.wait(1e-4):  # a moment for the scan
            present = engine.present()
            seen.add((present.phase, bool(present.moving)))

    onlooker = threading.Thread(target=watch)
    onlooker.start()
    engine.run(make_plan(small))
    over.set()
    onlooker.join()
    seen.add((engine.present().phase, False))
    assert {("moving", True), ("exposing", False), ("ending", False)} <= seen
    assert engine.present().lamp == "darkened"
