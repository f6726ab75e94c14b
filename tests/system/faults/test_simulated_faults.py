"""Every fault of the simulated bench, in every state of the engine: recovery or a named stop.

Never a wrong value: each accepted reading is that of the scan in which nothing failed, and going on
afterwards ends with the same readings as that one.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import pytest

from acquisition.rig import open_devices
from instrument.config.load import Loaded
from instrument.errors import DeviceError, GonioError, OperatorStop, StorageError
from instrument.record.reading import Reading
from instrument.record.record import Record
from sim.faults.faults import FAULTS, Faults
from sim.faults.triggers import When
from tests.support import faulty_scan
from tests.support.faulty_scan import Ended, Trigger, require_named
from tests.support.scans import small_scan, undated


def scan(
    loaded: Loaded, folder: Path, faults: Faults, disk: tuple[str, Trigger] | None = None
) -> Ended:
    return faulty_scan.scan(
        loaded, folder, lambda: open_devices(loaded, faults), faults.triggers, disk
    )


@pytest.fixture(scope="module")
def small() -> Loaded:
    return small_scan()


@dataclass(frozen=True)
class Sound:
    """A scan in which nothing failed: its readings, the calls that it made, its states."""

    readings: list[Reading]
    calls: list[str]
    states: dict[str, Trigger]


@pytest.fixture(scope="module")
def sound(small: Loaded, tmp_path_factory: pytest.TempPathFactory) -> Sound:
    faults = Faults()
    ended = scan(small, tmp_path_factory.mktemp("sound") / "run", faults)
    assert ended.error is None
    calls = faults.triggers.calls
    return Sound(ended.readings, calls, states(calls))


def states(calls: list[str]) -> dict[str, Trigger]:
    """A moment in each state of the engine, the later ones at the eighth step of the scan."""
    accepted = [n for n, call in enumerate(calls) if call == "record.add_reading"]
    grabs = (n for n, call in enumerate(calls) if call == "camera.grab" and n > accepted[6])
    first, rest = islice(grabs, 2)
    arrives = max(n for n, call in enumerate(calls[:first]) if call == "theta_r.wait")
    return {
        "idle": moment(calls, calls.index("theta_r.identity")),  # everybody says who they are
        "homing": moment(calls, calls.index("theta_r.home")),
        "moving": moment(calls, arrives),
        "settling": moment(calls, arrives, "after"),
        "exposing": moment(calls, first),  # the frame that the exposure is chosen by
        "reading": moment(calls, rest),  # the others are read out
        "writing": moment(calls, accepted[7]),  # while the stage moves on
    }


def moment(calls: list[str], number: int, when: When = "at") -> Trigger:
    """A call of the trace, as a fault names it."""
    return when, calls[number], calls[: number + 1].count(calls[number])


def reached(state: str) -> int:
    """Readings that are on disk when the fault strikes."""
    return 0 if state in ("idle", "homing") else 7


# What the operator is told: which error, and what it says of device and cause.
STOPS: dict[tuple[str, str], tuple[type[GonioError], str]] = {
    ("theta_r", "does not answer"): (DeviceError, "theta_r: no answer.*check its power"),
    ("theta_r", "stalls"): (DeviceError, "theta_r: (stalled|its reference was not).*find out what"),
    ("theta_r", "stops short"): (DeviceError, "theta_r: stands at .* instead of .*look for what"),
    ("theta_r", "slips"): (DeviceError, "theta_r: after the frames.*stands at.*look for what has"),
    ("theta_r", "loses its reference"): (DeviceError, "theta_r: reference lost: check"),
    ("theta_r", "meets its limit switch"): (DeviceError, "theta_r: limit switch met.*find out why"),
    ("camera", "gives torn frames"): (DeviceError, "camera: 4 bad frames in a row.*check"),
    ("camera", "is unplugged"): (DeviceError, "camera: not found.*check the USB cable"),
    ("lamp", "sticks"): (DeviceError, "lamp: its shutter does not .*check its cable"),
    ("operator", "refuses"): (OperatorStop, "stopped at the prompt: Put"),
    ("operator", "leaves"): (OperatorStop, "standard input ended: nobody answers"),
    ("disk", "refuse_writes"): (StorageError, "record.sqlite: cannot be written.*look at the"),
    ("disk", "fill_disk"): (StorageError, "record.sqlite: the disk is full.*make room"),
}
# Got over at once, with a retry in the record.
RETRIED = [("camera", "gives no frame"), ("camera", "gives a torn frame")]
EARLY, LATE = ("idle", "homing"), ("moving", "settling", "exposing", "reading", "writing")
# Got over because the engine's next act sets it right: homing finds the reference, a move ends at
# its target wherever it began.
SET_RIGHT = {
    ("theta_r", "loses its reference"): EARLY,
    ("theta_r", "slips"): (*EARLY, "moving", "writing"),
    ("lamp", "sticks"): LATE,  # it has been closed for the last time but for the end
}
LEFT_OUT = {
    ("operator", "refuses"): LATE,  # asked twice, at the beginning: see the test of the prompts
    ("operator", "leaves"): LATE,
    ("camera", "comes back"): (*EARLY, *LATE),  # no fault: see the test of the camera that does
}
PAIRS = [
    (device, fault, state)
    for device, fault in [*STOPS, *RETRIED]
    for state in (*EARLY, *LATE)
    if state not in LEFT_OUT.get((device, fault), ())
]


def test_no_fault_is_left_out() -> None:
    named = {(device, fault) for device, fault, _ in PAIRS} | set(LEFT_OUT)
    others = ("theta_i", "dphi")  # these have the faults of theta_r
    known = {(device, fault) for device, words in FAULTS.items() for fault in words}
    assert named >= {(device, fault) for device, fault in known if device not in others}


@pytest.mark.parametrize(("device", "fault", "state"), PAIRS)
def test_a_fault_in_a_state(
    small: Loaded, sound: Sound, tmp_path: Path, device: str, fault: str, state: str
) -> None:
    faults, disk = Faults(), None
    if device == "disk":
        disk = (fault, sound.states[state])
    else:
        faults.plan(device, fault, *sound.states[state])
    ended = scan(small, tmp_path / "run", faults, disk)
    assert faults.triggers.pending == 0  # it did happen
    require_right(ended, sound)
    set_right = state in SET_RIGHT.get((device, fault), ())
    if set_right or (device, fault) in RETRIED:
        assert ended.error is None
        assert len(ended.readings) == len(sound.readings)
        assert len(ended.events.get("retry", [])) == ((device, fault) in RETRIED)
    else:
        require_named(ended, *STOPS[device, fault], tmp_path / "run")
        assert len(ended.readings) >= reached(state)
    require_safe(faults, ended, device, fault)
    require_goes_on(small, sound, tmp_path / "run")


def require_right(ended: Ended, sound: Sound) -> None:
    """What was accepted is to the last digit what it would have been."""
    assert ended.readings == sound.readings[: len(ended.readings)]


def require_safe(faults: Faults, ended: Ended, device: str, fault: str) -> None:
    """Every axis was told to stop and the lamp to be dark, last of all; else somebody is told."""
    stops = ["theta_i.stop", "dphi.stop", "theta_r.stop", "lamp.darken"]
    assert faults.triggers.calls[-4:] == stops
    deaf = {"does not answer": "theta_r", "sticks": "lamp"}.get(fault)
    assert faults.scene is not None
    assert faults.scene.lit == (deaf == "lamp")
    if deaf is None:
        assert "trouble" not in ended.events
        return
    (trouble,) = ended.events["trouble"]
    assert trouble.startswith(f"{deaf} could not be made safe: {deaf}: ")
    if ended.error is not None:
        assert f"LOOK AT THE RIG FIRST: {trouble}" in str(ended.error)


def require_goes_on(loaded: Loaded, sound: Sound, folder: Path) -> None:
    """With a sound bench; a scan that was got over is whole already."""
    with Record.open(folder) as record:
        readings = undated(record.readings())
    if len(readings) < len(sound.readings):
        again = scan(loaded, folder, Faults())
        assert again.error is None
        readings = again.readings
    assert readings == sound.readings


@pytest.mark.parametrize(("fault", "reason"), [("refuses", "at the prompt"), ("leaves", "nobody")])
@pytest.mark.parametrize("prompt", [1, 2])
def test_a_prompt_that_is_not_answered(
    small: Loaded, sound: Sound, tmp_path: Path, prompt: int, fault: str, reason: str
) -> None:
    """The tile is put there first, then the sample; what was exposed before is accepted."""
    faults = Faults(f"operator {fault} at operator.ask {prompt}")
    ended = scan(small, tmp_path / "run", faults)
    require_named(ended, OperatorStop, reason, tmp_path / "run")
    require_right(ended, sound)
    assert len(ended.readings) == (0 if prompt == 1 else 2)
    require_safe(faults, ended, "operator", fault)
    require_goes_on(small, sound, tmp_path / "run")


@pytest.mark.parametrize("state", ["exposing", "reading"])
@pytest.mark.parametrize("tries", [1, 3])
def test_a_camera_that_comes_back(
    small: Loaded, sound: Sound, tmp_path: Path, state: str, tries: int
) -> None:
    """Plugged in again while the engine asks again: each try is in the record."""
    _, call, number = sound.states[state]
    faults = Faults(
        f"camera is unplugged at {call} {number}; camera comes back at {call} {number + tries}"
    )
    ended = scan(small, tmp_path / "run", faults)
    assert ended.error is None
    assert ended.readings == sound.readings
    assert [f"try {n} of 4" in text for n, text in enumerate(ended.events["retry"], 2)] == (
        [True] * tries
    )


@pytest.mark.parametrize("name", ["theta_i", "dphi", "theta_r"])
def test_an_axis_that_is_pushed_while_it_should_stand(
    small: Loaded, sound: Sound, tmp_path: Path, name: str
) -> None:
    """While the sample is put there somebody leans on it; the next move is theta_i's alone."""
    faults = Faults(f"{name} slips after operator.ask 2")
    ended = scan(small, tmp_path / "run", faults)
    require_right(ended, sound)
    if name == "theta_i":
        assert ended.error is None  # it was moved next, and came to where it should
    else:
        says = f"{name}: after the frames were taken, .* stands at .*.3 deg instead of"
        require_named(ended, DeviceError, says, tmp_path / "run")
        assert len(ended.readings) == 2
    require_goes_on(small, sound, tmp_path / "run")


def test_a_shutter_that_stays_open_at_the_end_is_told(
    small: Loaded, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    last = "after record.add_reading 16"
    ended = scan(small, tmp_path / "run", Faults(f"lamp sticks {last}"))
    assert ended.error is None
    assert "LOOK AT THE RIG FIRST: lamp could not be made safe" in capsys.readouterr().err


def test_two_devices_that_fail_together_are_both_told(
    small: Loaded, sound: Sound, tmp_path: Path
) -> None:
    text = "theta_i does not answer at camera.grab 20; camera is unplugged at camera.grab 20"
    ended = scan(small, tmp_path / "run", Faults(text))
    require_named(ended, DeviceError, "camera: not found", tmp_path / "run")
    assert "LOOK AT THE RIG FIRST: theta_i could not be made safe" in str(ended.error)
    require_right(ended, sound)
    require_goes_on(small, sound, tmp_path / "run")


def test_a_mistake_of_the_program_is_in_the_record(small: Loaded, tmp_path: Path) -> None:
    """Whatever ends a scan: the rig is made safe, and the record says why."""
    faults = Faults()

    def fail() -> None:
        raise ZeroDivisionError("a mistake")

    faults.triggers.plan("at", "camera.grab", 20, fail)
    with pytest.raises(ZeroDivisionError):
        scan(small, tmp_path / "run", faults)
    assert faults.triggers.calls[-1] == "lamp.darken"
    with Record.open(tmp_path / "run") as record:
        (why,) = [text for _, kind, text in record.events() if kind == "fault"]
    assert why == "the program failed: ZeroDivisionError('a mistake')"


@pytest.mark.slow
def test_every_fault_at_calls_all_over_a_scan(
    small: Loaded, sound: Sound, tmp_path: Path, slow: bool
) -> None:
    """And of one that goes on: whatever is struck, and when, no accepted reading is another.

    Of the 5642 pairs of fault and call every eleventh, which has each fault at 19 or 20 calls.
    """
    every = [(device, fault) for device, words in FAULTS.items() for fault in words]
    cases = [(n, *one) for n in range(len(sound.calls)) for one in every]
    outcomes: Counter[str] = Counter()
    for number, device, fault in cases[:: 11 if slow else 397]:
        folder = tmp_path / f"{number} {device} {fault}"
        faults = Faults()
        faults.plan(device, fault, *moment(sound.calls, number))
        ended = scan(small, folder, faults)
        require_right(ended, sound)
        again = Faults()  # the same once more, while the scan goes on
        again.plan(device, fault, *moment(sound.calls, number))
        if ended.error is not None:
            require_right(scan(small, folder, again), sound)
        require_goes_on(small, sound, folder)
        outcomes[type(ended.error).__name__] += 1
    assert set(outcomes) >= {"NoneType", "DeviceError"}
