"""Verdict on a trial: whether the axis stood in time or a line says that it may not."""

from __future__ import annotations

import math
import re
from bisect import bisect
from dataclasses import dataclass

from tests.support.stop_trials.files import PROTOCOL, U_DEG
from tests.support.stop_trials.run_trial import Seen
from tests.support.stop_trials.trial import ENDS_NO_PROGRAM, MAX_DEG, MIN_DEG, Trial

STANDS_WITHIN_S = 0.5  # promised, beyond the braking time
CODES = (0, 3, 4)  # of the table of exit codes: the input of a trial is right
TOLERANCE_DEG = 3 * U_DEG
_KILLED = -9  # by SIGKILL
_DELAY_S = 0.005  # a thread that wakes later than this was kept waiting by the machine
# Lines by which a person knows that the axis may be moving.
_MAY_MOVE = re.compile(r"LOOK AT THE RIG FIRST|may (still )?(be )?mov|still moves|may go on")
_ENDED = "all motion has ended"


@dataclass(frozen=True, slots=True)
class Verdict:
    """Verdict: `how` is stood, said, ended (by itself, with 0), or for a dead program finished.

    busy: it stood late, and the machine kept it waiting for that long; that proves nothing.

    `after_s`: from the moment at which a stop was possible to the standstill; `late_s`: for how
    long the machine kept devices and program waiting within it. `moved`: the axis was moving when
    it was struck.
    """

    how: str
    exceptions: tuple[str, ...]
    after_s: float = math.nan
    braking_s: float = math.nan
    late_s: float = 0.0
    moved: bool = False


def verdict(trial: Trial, seen: Seen) -> Verdict:
    """Judge a trial by the devices' own log and by what the command said."""
    wrong = [*_crashes(seen), *_out_of_bounds(trial, seen)]
    if math.isnan(seen.struck_s):
        return Verdict("ended", (*wrong, *_unasked_end(seen)))
    moved = _moved(seen)
    if trial.fault in ENDS_NO_PROGRAM and seen.code != _KILLED:  # it was too late
        return Verdict("ended", (*wrong, *_unasked_end(seen)))
    if trial.fault in ENDS_NO_PROGRAM:
        wrong += [*_unfinished(seen), *_not_told(trial, seen)]
        return Verdict("finished", tuple(wrong), moved=moved)
    after_s, braking_s, late_s = _standstill(trial, seen)
    in_time = after_s <= STANDS_WITHIN_S + braking_s
    if seen.code == 0 and _arrived(seen) and (in_time or not trial.signal):
        return Verdict("ended", tuple(wrong), moved=moved)
    how = "stood" if in_time else "said" if says_that_it_may_move(seen.text) else "busy"
    if how == "busy" and after_s > STANDS_WITHIN_S + braking_s + late_s:
        wrong.append(
            f"stood after {after_s:.2f} s (braking {braking_s:.2f} s, waited {late_s:.2f} s), and "
            f"no line says so: {seen.text[-400:]!r}"
        )
    if seen.at_end["moving"] and _ENDED in seen.text:
        wrong.append(f"moves when the command has said: {seen.text[-300:]!r}")
    if math.isinf(trial.seconds) and _ENDED in seen.text:
        wrong.append(f"says what it cannot have read: {seen.text[-300:]!r}")
    return Verdict(how, tuple(wrong), after_s, braking_s, late_s, moved)


def says_that_it_may_move(text: str) -> bool:
    """True if a line names the axis and says that it may be moving."""
    return any("theta_r" in line and _MAY_MOVE.search(line) for line in text.splitlines())


def _crashes(seen: Seen) -> list[str]:
    """Tracebacks, exit codes that the table does not list, and commands that do not end."""
    found = []
    for name, code, text in (
        ("command", seen.code, seen.text), ("next start", seen.next_code, seen.next_text)
    ):  # fmt: skip
        if "Traceback" in text:
            found.append(f"{name}: traceback: {text[-600:]!r}")
        if code is not None and code not in (*CODES, _KILLED):
            found.append(f"{name}: exit code {code}: {text[-300:]!r}")
    if seen.code is None:
        found.append(f"the command did not end: {seen.text[-300:]!r}")
    return found


def _unasked_end(seen: Seen) -> list[str]:
    """Return what is wrong with a command that ended before its moment came.

    On a machine that is too busy to answer in time the program may stop the axis by itself.
    """
    if seen.code in (0, 3) and not seen.at_end["moving"]:
        return []
    return [f"ended by itself with {seen.code}: {seen.text[-300:]!r}"]


def _out_of_bounds(trial: Trial, seen: Seen) -> list[str]:
    """Motions beyond the limits, and moves to what nobody has asked for."""
    scanned = PROTOCOL["sweeps"][0]["theta_r_deg"]  # type: ignore[index]  # a mapping of this form
    asked = [trial.target_deg, trial.start_deg]
    if trial.command != "move":
        asked = [0.0, *scanned]
    found = []
    for motion in seen.at_rest.get("motions", []):
        ends = (motion["from_deg"], motion["to_deg"])
        if not all(MIN_DEG - 1 <= end <= MAX_DEG + 1 for end in ends):
            found.append(f"beyond the limits: {motion}")
        # An approach against the backlash ends half a degree beyond the target.
        if motion["kind"] == "move" and min(abs(motion["to_deg"] - a) for a in asked) > 0.6:
            found.append(f"not asked for: {motion}")
    return found


def _unfinished(seen: Seen) -> list[str]:
    """Return what is wrong where the program could not stop the axis: it ends its last motion."""
    motions, at_deg = seen.at_rest["motions"], seen.at_rest["position_deg"]
    if seen.at_rest["moving"]:
        return [f"still moves: {motions[-1]}"]
    if motions and motions[-1]["kind"] != "brake":
        off_deg = abs(at_deg - motions[-1]["to_deg"])
        return [f"{off_deg:g} deg off its target: {motions[-1]}"] if off_deg > 0.01 else []
    return []


def _not_told(trial: Trial, seen: Seen) -> list[str]:
    """Return what the next start has left unsaid: where it found the axis, or that it moves."""
    found = []
    if trial.fault == "frozen for ever" and "wait for its end" not in seen.refused_text:
        found.append(f"a second start is not refused: {seen.refused_text[-300:]!r}")
    moving, text = seen.next_found["moving"], seen.next_text
    ended_deg = seen.next_found["motions"][-1]["to_deg"]
    known = seen.next_found["referenced"] or moving
    told = _names(ended_deg, text) or (moving and "moving" in text)
    if known and not told:
        found.append(
            f"found {'moving to' if moving else 'at'} {ended_deg:.3f} deg, and the next start does "
            f"not say so: {text!r}"
        )
    return found


def _names(at_deg: float, text: str) -> bool:
    """True if a number of the text is this angle."""
    numbers = map(float, re.findall(r"-?\d+(?:\.\d+)?", text))
    return any(abs(number - at_deg) <= TOLERANCE_DEG for number in numbers)


def _arrived(seen: Seen) -> bool:
    """True if the last motion has come to its own end."""
    motions = seen.at_rest["motions"]
    return bool(motions) and motions[-1]["kind"] != "brake" and not seen.at_rest["moving"]


def _standstill(trial: Trial, seen: Seen) -> tuple[float, float, float]:
    """Return the time to the standstill, the braking time in it, and the machine's delays."""
    motions = seen.at_rest["motions"]
    stood_s = motions[-1]["ends_s"]
    brakes_s = stood_s  # from when on: a stop that is sent again goes on braking
    for motion in reversed(motions):
        if motion["kind"] != "brake":
            break
        brakes_s = motion["begun_s"]
    begun_s = seen.reachable_s
    if trial.fault == "frozen" and not trial.signal:  # thawed, it may go on, and be stopped later
        begun_s = max(begun_s, min(brakes_s, seen.ended_s))
    late = seen.at_end["late"]
    devices_s = sum(s for at_s, s in late if seen.struck_s <= at_s <= stood_s and s > _DELAY_S)
    late_s = devices_s + seen.strike_took_s + _waited_s(seen.waits, seen.struck_s, stood_s)
    return max(stood_s - begun_s, 0.0), stood_s - brakes_s, late_s


def _moved(seen: Seen) -> bool:
    """Return whether a motion was under way when the trial struck."""
    begun = [m for m in seen.at_rest["motions"] if m["begun_s"] <= seen.struck_s]
    return bool(begun) and begun[-1]["ends_s"] > seen.struck_s


def _waited_s(waits: list[tuple[float, dict[str, float]]], from_s: float, to_s: float) -> float:
    """Return for how long the program had no processor between two times.

    One thread may wait for another: the two that waited longest count.
    """
    if not waits:
        return 0.0
    times = [at_s for at_s, _ in waits]
    before = waits[max(bisect(times, from_s) - 1, 0)][1]
    after = waits[min(bisect(times, to_s), len(waits) - 1)][1]
    return sum(sorted(after[thread] - before.get(thread, 0.0) for thread in after)[-2:])
