"""References of a scan, judged one by one: each must prove lamp and tile before it is accepted."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from acquisition.interlocks.lamp_checks import check_text, compared, failed, stopped_check
from acquisition.interlocks.reference_level import angle_doubt, level_doubt, repeat_doubt
from acquisition.measure.drift import Drift, rate
from instrument.config.protocol import WhiteTile
from instrument.config.rig import Rig
from instrument.record.reading import Check, Reading

_LOOK = {
    "tile": "look at the lamp, its shutter and its angle, and whether the tile is on the table",
    "drift": (
        "look at the lamp and its shutter, let it warm up, and see that neither sample nor camera "
        "has moved and that the sample is not too dark or too glossy for the view angle of "
        "references.drift_check"
    ),
}


@dataclass(slots=True)
class References:
    """Tile readings and drift checks that a scan has accepted, and the checks at each resume."""

    rig: Rig
    white_tile: WhiteTile | None = None
    readings: list[Reading] = field(default_factory=list)
    checks: list[Check] = field(default_factory=list)
    _unbroken: set[int] = field(default_factory=set)  # steps since the program was started

    def restore(self, readings: Iterable[Reading], checks: Iterable[Check]) -> None:
        """Take over what a scan has accepted so far."""
        self.readings, self.checks = list(readings), list(checks)

    def accept(self, reading: Reading) -> None:
        """Let later references be compared with this one."""
        self.readings.append(reading)
        self._unbroken.add(reading.step)

    def doubt(self, reading: Reading) -> str:
        """Return why a tile reading or drift check cannot be accepted, empty if it can."""
        if reading.kind == "drift":
            check = compared(reading, self.readings, self.checks, reading.step)
            if failed(check):
                return f"drift check: {check_text(check)}"
        if level := level_doubt(reading, self.rig):
            return f"light: {level}"
        other, text = self._contradicting(reading)
        if other is None:
            return ""
        again = other.lamp_setting == reading.lamp_setting
        return f"white tile: {text}" if again else f"lamp angle: {text}"

    def failed_checks(self, reading: Reading) -> list[Check]:
        """Return the checks to record, which make earlier readings doubtful.

        Where two readings of the tile contradict one another either may be wrong, and with it all
        that was measured at its setting of the lamp.
        """
        other, _ = self._contradicting(reading)
        if reading.kind == "drift":
            made = [compared(reading, self.readings, self.checks, reading.step)]
            return [check for check in made if failed(check)]
        both = [] if other is None else [other, reading]
        return [
            Check(
                before_step=reading.step, expected=rate(tile), u_expected=0.0, jumped=False,
                reading=replace(tile, time_s=reading.time_s, free_s=reading.free_s),
            )
            for tile in both
        ]  # fmt: skip

    def stopped_check(self, block: int, time_s: float) -> Check | None:
        """Return the check that stands for an interlock; None if the block has had none yet."""
        own = [r for r in self.readings if r.block == block and r.kind == "drift"]
        return stopped_check(own[-1], time_s) if own else None

    def _contradicting(self, reading: Reading) -> tuple[Reading | None, str]:
        """Return an earlier reading of the tile that contradicts one, and how; None and empty."""
        if reading.kind != "tile" or reading.flags or level_doubt(reading, self.rig):
            return None, ""
        blocks = {r.block for r in (*self.readings, reading)}
        drifts = {block: Drift.of(self.readings, block, self.checks) for block in blocks}
        for other in self._comparable(reading):
            if other.lamp_setting == reading.lamp_setting:
                text = repeat_doubt(reading, other, drifts[reading.block], self.rig)
            else:
                text = angle_doubt(reading, other, drifts, self.rig, self.white_tile)
            if text:
                return other, text
        return None, ""

    def _comparable(self, tile: Reading) -> list[Reading]:
        """Return the readings of the tile by the same lamp, or one that drift checks connect.

        That of the same setting of the lamp comes first: it tells most.
        """
        tiles = [r for r in self.readings if r.kind == "tile"]
        known = [r for r in tiles if r.block == tile.block or r.step in self._unbroken]
        return sorted(known, key=lambda r: r.lamp_setting != tile.lamp_setting)


def what_to_look_at(reading: Reading) -> str:
    """Return what may be wrong with a reference that cannot be accepted."""
    return _LOOK[reading.kind]
