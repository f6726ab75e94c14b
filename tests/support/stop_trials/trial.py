"""One trial of a stop, drawn from a seed: controller, command, fault, signal and their moments."""

from __future__ import annotations

import random
from dataclasses import dataclass

CONTROLLERS = ("zaber", "smc100", "conex", "az rtu", "az tcp")
SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT")
BEFORE_FIRST_S = 60.0  # for a command to begin its motion on a busy machine
MIN_DEG, MAX_DEG = -88.0, 88.0  # of the axis in both rig files of a trial

# Each fault as often as it stands here; the first twelve are all there are.
FAULTS = (
    "lost byte", "killed", "unplugged", "hung disk", "frozen", "noise", "dropped terminal",
    "frozen for ever", "garbled byte", "held record", "lost answers", "none",
    "lost byte", "killed", "unplugged", "hung disk", "noise", "lost byte", "killed",
    "dropped terminal", "unplugged", "frozen", "hung disk", "lost byte",
)  # fmt: skip
ENDS_NO_PROGRAM = ("killed", "frozen for ever")
GOES_ON = ("frozen", "unplugged")  # the command may go on once the fault is over
ON_DISK = ("hung disk", "held record")


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One trial.

    `signal` is empty where only the fault itself may end the command. `moment` is a part of the
    motion's duration at which the signal is sent, or the fault begins where it comes without one;
    `number` of the motion, counted from 1; in a scan whose disk hangs, of the one before. `back`:
    the byte is one of the first answer after the stop. `times`: of so many messages; the program
    sends a stop twice at once.
    `ahead_s` is how long before a signal its fault begins. `at` is the place in a message, as a
    part of its length, and `seconds` the duration of a fault, infinite where it stays.
    """

    seed: int
    controller: str
    command: str
    motion: str
    fault: str
    signal: str
    moment: float
    ahead_s: float
    at: float
    back: bool
    times: int
    seconds: float
    real_start: bool
    at_once: bool
    speed_deg_per_s: float
    acceleration_deg_per_s2: float
    homing_s: float
    start_deg: float
    target_deg: float
    number: int

    @property
    def name(self) -> str:
        """Short name of what happens, for a report."""
        how = self.signal or "no signal"
        return f"{self.seed}: {self.controller}, {self.command} {self.motion}, {self.fault}, {how}"


def draw(seed: int) -> Trial:
    """Return the trial of a seed."""
    rng = random.Random(seed)
    fault = FAULTS[seed % len(FAULTS)]
    controller = rng.choice(CONTROLLERS)
    if fault == "noise":  # what an XOFF does depends on the line's flow control
        controller = rng.choice(("smc100", "smc100", "smc100", "zaber", "conex", "az rtu"))
    motion = rng.choice(("moving", "homing"))
    command = {"moving": "move", "homing": "home"}[motion]
    if fault in ON_DISK or rng.random() < 0.2:
        command = "run"
    speed = rng.uniform(40.0 if command == "run" else 20.0, 60.0)
    start, target = _way(rng)
    return Trial(
        seed=seed,
        controller=controller,
        command=command,
        motion=motion,
        fault=fault,
        signal=_signal(rng, fault),
        moment=_moment(rng),
        ahead_s=rng.choice((0.0, rng.uniform(0.0, 0.05), rng.uniform(0.0, 0.5))),
        at=rng.random(),
        back=rng.random() < 0.25,
        times=rng.choice((1, 2)),
        seconds=_seconds(rng, fault),
        real_start=command != "run" and rng.random() < 0.12,
        at_once=rng.random() < 0.5,
        speed_deg_per_s=speed,
        acceleration_deg_per_s2=speed / rng.uniform(0.05, 0.6),
        # No faster than a move, as controllers look for a reference; before a move not judged.
        homing_s=max(rng.uniform(0.8, 3.0), abs(start) / speed) if motion == "homing" else 0.2,
        start_deg=start,
        target_deg=target,
        number=_number(rng, fault, command, motion),
    )


def _number(rng: random.Random, fault: str, command: str, motion: str) -> int:
    """Return the number of the motion; a scan's first readings wait for the disk before a move."""
    if command != "run" or motion == "homing":
        return 1
    return rng.choice((1, 2, 2, 3, 3, 3) if fault in ON_DISK else (1, 2))


def _way(rng: random.Random) -> tuple[float, float]:
    """Return where the axis stands and where it is sent, at least 60 degrees apart."""
    start = rng.uniform(-85.0, 25.0)
    target = rng.uniform(start + 60.0, 87.0)
    return (start, target) if rng.random() < 0.5 else (-start, -target)


def _signal(rng: random.Random, fault: str) -> str:
    if fault in ENDS_NO_PROGRAM:
        return ""
    if fault == "dropped terminal":
        return "terminal"
    if fault in GOES_ON and rng.random() < 0.5:
        return ""
    return rng.choice(SIGNALS)


def _moment(rng: random.Random) -> float:
    """Return a moment within the motion, sometimes just at its begin or its end."""
    where = rng.random()
    if where < 0.1:
        return rng.uniform(0.0, 0.02)
    return rng.uniform(0.95, 1.02) if where < 0.15 else rng.uniform(0.02, 0.9)


def _seconds(rng: random.Random, fault: str) -> float:
    match fault:
        case "hung disk" | "held record":
            return rng.uniform(1.0, 4.0)
        case "lost answers" | "unplugged":
            return rng.choice((rng.uniform(0.02, 0.4), rng.uniform(0.4, 2.5), float("inf")))
        case "frozen":
            return rng.choice((rng.uniform(0.05, 0.5), rng.uniform(0.5, 2.5)))
        case _:
            return 0.0
