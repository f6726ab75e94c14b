"""Every fault of the simulated devices in every state of the engine: recovery or a clear stop.

Never a wrong value: each accepted reading equals that of the undisturbed scan, and resuming
afterwards completes the scan with the same readings.
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
from tests.support.scans import shortest_scan, undated
from tests.support.whole_scans import faulty_scan
from tests.support.whole_scans.faulty_scan import ScanResult, Trigger, require_reported


def scan(
    loaded: Loaded, folder: Path, faults: Faults, disk: tuple[str, Trigger] | None = None
) -> ScanResult:
    return faulty_scan.scan(
        loaded, folder, lambda: open_devices(loaded, faults), faults.triggers, disk
    )


BEFORE = 5  # readings before the step in which a fault occurs; that step is a drift check


@pytest.fixture(scope="module")
def small() -> Loaded:
    return shortest_scan()


@dataclass(frozen=True)
class SoundScan:
    """A scan without faults: its readings, its device calls, and a call in each engine state."""

    readings: list[Reading]
    calls: list[str]
    states: dict[str, Trigger]


@pytest.fixture(scope="module")
def sound(small: Loaded, tmp_path_factory: pytest.TempPathFactory) -> SoundScan:
    faults = Faults()
    result = scan(small, tmp_path_factory.mktemp("sound") / "run", faults)
    assert result.error is None
    calls = faults.triggers.calls
    return SoundScan(result.readings, calls, states(calls))


def states(calls: list[str]) -> dict[str, Trigger]:
    """A trigger in each state of the engine, the later ones at the sixth step of the scan."""
    accepted = [n for n, call in enumerate(calls) if call == "record.add_reading"]
    grabs = (n for n, call in enumerate(calls) if call == "camera.grab")
    first, rest = islice((n for n in grabs if n > accepted[BEFORE - 1]), 2)
    arrives = max(n for n, call in enumerate(calls[:first]) if call == "theta_r.wait")
    return {
        "idle": trigger(calls, calls.index("theta_r.identity")),  # devices are identified
        "homing": trigger(calls, calls.index("theta_r.home")),
        "moving": trigger(calls, arrives),
        "settling": trigger(calls, arrives, "after"),
        "exposing": trigger(calls, first),  # the frame that determines the exposure
        "reading": trigger(calls, rest),  # the other frames
        "writing": trigger(calls, accepted[BEFORE]),  # while the stage moves on
    }


def trigger(calls: list[str], index: int, when: When = "at") -> Trigger:
    """The call at `index`, in the terms in which a fault is planned."""
    return when, calls[index], calls[: index + 1].count(calls[index])


def readings_before(state: str) -> int:
    """Number of readings on disk when a fault occurs in that state."""
    return 0 if state in ("idle", "homing") else BEFORE


# Faults that end the scan: error class, and what the message says about device and cause.
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
# Faults overcome at once, with their number of events: loss and return, or a frame taken anew.
RETRIED = {("camera", "gives no frame"): 2, ("camera", "gives a torn frame"): 1}
EARLY, LATE = ("idle", "homing"), ("moving", "settling", "exposing", "reading", "writing")
# States in which the engine's next action removes the fault: homing restores the reference, and a
# move ends at its target wherever it began.
REMOVED = {
    ("theta_r", "loses its reference"): EARLY,
    ("theta_r", "slips"): (*EARLY, "moving", "writing"),
    ("lamp", "sticks"): LATE,  # the shutter is not closed again before the end
}
NOT_TESTED_HERE = {
    ("operator", "refuses"): LATE,  # asked twice, at the beginning: see the test of the prompts
    ("operator", "leaves"): LATE,
    ("camera", "comes back"): (*EARLY, *LATE),  # no fault: see the test of the returning camera
}
CASES = [
    (device, fault, state)
    for device, fault in [*STOPS, *RETRIED]
    for state in (*EARLY, *LATE)
    if state not in NOT_TESTED_HERE.get((device, fault), ())
]


def test_all_faults_are_covered() -> None:
    covered = {(device, fault) for device, fault, _ in CASES} | set(NOT_TESTED_HERE)
    others = ("theta_i", "dphi")  # these have the faults of theta_r
    known = {(device, fault) for device, words in FAULTS.items() for fault in words}
    assert covered >= {(device, fault) for device, fault in known if device not in others}


@pytest.mark.parametrize(("device", "fault", "state"), CASES)
def test_a_fault_in_each_state(
    small: Loaded, sound: SoundScan, tmp_path: Path, device: str, fault: str, state: str
) -> None:
    faults, disk = Faults(), None
    if device == "disk":
        disk = (fault, sound.states[state])
    else:
        faults.plan(device, fault, *sound.states[state])
    result = scan(small, tmp_path / "run", faults, disk)
    assert faults.triggers.pending == 0  # the fault did occur
    require_correct(result, sound)
    removed = state in REMOVED.get((device, fault), ())
    if removed or (device, fault) in RETRIED:
        assert result.error is None
        assert len(result.readings) == len(sound.readings)
        assert len(result.events.get("retry", [])) == RETRIED.get((device, fault), 0)
    else:
        require_reported(result, *STOPS[device, fault], tmp_path / "run")
        # A disk that fails while the axis moves fails the reading that is written meanwhile.
        assert len(result.readings) >= readings_before(state) - (device == "disk")
    require_safe(faults, result, device, fault)
    require_resumable(small, sound, tmp_path / "run")


def require_correct(result: ScanResult, sound: SoundScan) -> None:
    """The accepted readings are bit for bit those of the undisturbed scan."""
    assert result.readings == sound.readings[: len(result.readings)]


def require_safe(faults: Faults, result: ScanResult, device: str, fault: str) -> None:
    """The last calls stop every axis and darken the lamp; a device that ignores this is named."""
    # What moves is stopped first; a reading may be written meanwhile.
    *stops, lamp = [call for call in faults.triggers.calls if call != "record.add_reading"][-4:]
    assert (sorted(stops), lamp) == (["dphi.stop", "theta_i.stop", "theta_r.stop"], "lamp.darken")
    unsafe = {"does not answer": "theta_r", "sticks": "lamp"}.get(fault)
    assert faults.scene is not None
    assert faults.scene.lit == (unsafe == "lamp")
    if unsafe is None:
        assert "trouble" not in result.events
        return
    (trouble,) = result.events["trouble"]
    assert trouble.startswith(f"{unsafe} could not be made safe: {unsafe}: ")
    if result.error is not None:
        assert f"LOOK AT THE RIG FIRST: {trouble}" in str(result.error)


def require_resumable(loaded: Loaded, sound: SoundScan, folder: Path) -> None:
    """Resuming with sound devices completes the scan, unless it is complete already."""
    with Record.open(folder) as record:
        readings = undated(record.readings())
    if len(readings) < len(sound.readings):
        resumed = scan(loaded, folder, Faults())
        assert resumed.error is None
        readings = resumed.readings
    assert readings == sound.readings


@pytest.mark.parametrize(("fault", "reason"), [("refuses", "at the prompt"), ("leaves", "nobody")])
@pytest.mark.parametrize("prompt", [1, 2])
def test_an_unanswered_prompt(
    small: Loaded, sound: SoundScan, tmp_path: Path, prompt: int, fault: str, reason: str
) -> None:
    """The first prompt asks for the tile, the second for the sample; earlier readings are kept."""
    faults = Faults(f"operator {fault} at operator.ask {prompt}")
    result = scan(small, tmp_path / "run", faults)
    require_reported(result, OperatorStop, reason, tmp_path / "run")
    require_correct(result, sound)
    assert len(result.readings) == (0 if prompt == 1 else 2)
    require_safe(faults, result, "operator", fault)
    require_resumable(small, sound, tmp_path / "run")


@pytest.mark.parametrize("state", ["exposing", "reading"])
@pytest.mark.parametrize("tries", [1, 3, 25])
def test_a_camera_that_returns(
    small: Loaded,
    sound: SoundScan,
    tmp_path: Path,
    state: str,
    tries: int,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Plugged in again while the engine waits: one event at the loss, one at the return."""
    _, call, number = sound.states[state]
    faults = Faults(
        f"camera is unplugged at {call} {number}; camera comes back at {call} {number + tries}"
    )
    result = scan(small, tmp_path / "run", faults)
    assert result.error is None
    assert result.readings == sound.readings
    lost, back = result.events["retry"]
    assert lost.startswith("camera: not found")
    assert back.startswith("camera: back after")
    shown = "".join(capsys.readouterr().err.split())
    assert "".join(lost.split()) in shown  # the person at the rig sees both
    assert "".join(back.split()) in shown


@pytest.mark.parametrize("name", ["theta_i", "dphi", "theta_r"])
def test_an_axis_pushed_while_it_should_stand_still(
    small: Loaded, sound: SoundScan, tmp_path: Path, name: str
) -> None:
    """The axis is pushed while the sample is being mounted; the next move is theta_i's alone."""
    faults = Faults(f"{name} slips after operator.ask 2")
    result = scan(small, tmp_path / "run", faults)
    require_correct(result, sound)
    if name == "theta_i":
        assert result.error is None  # the next move corrected it
    else:
        message = f"{name}: after the frames were taken, .* stands at .*.3 deg instead of"
        require_reported(result, DeviceError, message, tmp_path / "run")
        assert len(result.readings) == 2
    require_resumable(small, sound, tmp_path / "run")


def test_a_shutter_that_stays_open_at_the_end_is_reported(
    small: Loaded, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    last = "after record.add_reading 9"
    result = scan(small, tmp_path / "run", Faults(f"lamp sticks {last}"))
    assert result.error is None
    assert "LOOK AT THE RIG FIRST: lamp could not be made safe" in capsys.readouterr().err


def test_two_devices_that_fail_together_are_both_reported(
    small: Loaded, sound: SoundScan, tmp_path: Path
) -> None:
    text = "theta_i does not answer at camera.grab 20; camera is unplugged at camera.grab 20"
    result = scan(small, tmp_path / "run", Faults(text))
    require_reported(result, DeviceError, "camera: not found", tmp_path / "run")
    assert "LOOK AT THE RIG FIRST: theta_i could not be made safe" in str(result.error)
    require_correct(result, sound)
    require_resumable(small, sound, tmp_path / "run")


def test_a_program_error_is_recorded_and_leaves_the_rig_safe(small: Loaded, tmp_path: Path) -> None:
    faults = Faults()

    def fail() -> None:
        raise ZeroDivisionError("a mistake")

    faults.triggers.plan("at", "camera.grab", 20, fail)
    with pytest.raises(ZeroDivisionError):
        scan(small, tmp_path / "run", faults)
    assert faults.triggers.calls[-1] == "lamp.darken"
    with Record.open(tmp_path / "run") as record:
        (cause,) = [text for _, kind, text in record.events() if kind == "fault"]
    assert cause == "the program failed: ZeroDivisionError('a mistake')"


@pytest.mark.slow
def test_faults_at_calls_all_over_a_scan(
    small: Loaded, sound: SoundScan, tmp_path: Path, slow: bool
) -> None:
    """No accepted reading is wrong, whatever fails and when, also in the resumed scan.

    With --slow every seventh of the 4368 pairs of fault and call: each fault at 24 calls.
    """
    every = [(device, fault) for device, words in FAULTS.items() for fault in words]
    cases = [(n, *one) for n in range(len(sound.calls)) for one in every]
    outcomes: Counter[str] = Counter()
    for number, device, fault in cases[:: 7 if slow else 293]:
        folder = tmp_path / f"{number} {device} {fault}"
        faults = Faults()
        faults.plan(device, fault, *trigger(sound.calls, number))
        result = scan(small, folder, faults)
        require_correct(result, sound)
        again = Faults()  # the same fault in the resumed scan
        again.plan(device, fault, *trigger(sound.calls, number))
        if result.error is not None:
            require_correct(scan(small, folder, again), sound)
        require_resumable(small, sound, folder)
        outcomes[type(result.error).__name__] += 1
    assert set(outcomes) >= {"NoneType", "DeviceError"}
