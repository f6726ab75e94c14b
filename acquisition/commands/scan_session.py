"""One scan, from opening the devices to the last reading; what ends it early is written down."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing

from acquisition.engine.engine import Devices, Engine
from acquisition.engine.event_log import EventLogHandler, log_to_record
from acquisition.engine.resume import Progress
from acquisition.plan.plan import Plan, Step
from acquisition.rig import open_devices
from acquisition.terminal.console import console, duration_text, progress_bar
from instrument.clock import Clock, SystemClock
from instrument.config.load import Loaded
from instrument.errors import DeviceError, OperatorStop, StorageError
from instrument.record.event_kinds import FAULT, FINISHED, STOPPED
from instrument.record.record import Record


def scan(loaded: Loaded, plan: Plan, record: Record, progress: Progress | None = None) -> None:
    """Run the plan, or what is missing of it; the caller has claimed the run.

    Raises `OperatorStop`, `DeviceError` or `StorageError` with the command that goes on.
    """
    clock: Clock = SystemClock()
    with log_to_record(record) as notes:
        try:
            with closing(open_devices(loaded)) as devices:
                clock = devices.clock
                _drive(loaded, plan, record, progress, devices, notes)
        except (KeyboardInterrupt, OperatorStop) as stop:
            why = str(stop) or "stopped by the operator"
            _write_down(record, notes, clock, STOPPED, why)
            ended = "" if notes.troubles else ": all motion has ended."
            raise OperatorStop(f"{why}{ended} {_go_on(record, notes)}") from None
        except (DeviceError, StorageError) as error:
            _write_down(record, notes, clock, FAULT, str(error))
            raise type(error)(f"{error}\n{_go_on(record, notes)}") from error
        except Exception as error:
            _write_down(record, notes, clock, FAULT, f"the program failed: {error!r}")
            raise


def _drive(
    loaded: Loaded,
    plan: Plan,
    record: Record,
    progress: Progress | None,
    devices: Devices,
    notes: EventLogHandler,
) -> None:
    clock, before = devices.clock, progress or Progress()
    begun_s = clock.now_s() - before.elapsed_s
    console.print(
        f"{loaded.protocol.name}: {len(plan.points)} geometries, about "
        f"{duration_text(plan.duration_s)} on the rig ({loaded.rig.name}), into {record.folder}",
        highlight=False,
        soft_wrap=True,
    )
    with progress_bar(plan, before.done) as show:
        told = _both(show, notes)
        Engine(loaded.protocol, loaded.rig, devices, record, told).run(plan, progress)
    notes.write()
    record.add_event(clock.utc().isoformat(), FINISHED, f"{len(plan.steps)} steps")
    record.set_meta("scan_s", f"{clock.now_s() - begun_s:.1f}")
    record.set_meta("finished_utc", clock.utc().isoformat(timespec="seconds"))
    console.print(_unsafe(notes), end="", highlight=False, soft_wrap=True)


def _both(show: Callable[[Step], None], notes: EventLogHandler) -> Callable[[Step], None]:
    def on_step(step: Step) -> None:
        notes.write()
        show(step)

    return on_step


def _write_down(record: Record, notes: EventLogHandler, clock: Clock, kind: str, why: str) -> None:
    """Note why a scan ended; where the disk takes nothing more, the message alone has to tell."""
    try:
        notes.write()
        record.add_event(clock.utc().isoformat(), kind, why)
    except StorageError:
        return


def _go_on(record: Record, notes: EventLogHandler) -> str:
    """What is not safe, what is, and the command that goes on."""
    where = record.current_folder()
    if where is None:
        return f"{_unsafe(notes)}Nothing is left to go on from"
    safe = f"{len(record.readings())} readings are safe in {where}"
    return f"{_unsafe(notes)}{safe}. Go on with: gonio resume {where}"


def _unsafe(notes: EventLogHandler) -> str:
    """What a person has to see to, a line each; nothing where all is well."""
    return "".join(f"LOOK AT THE RIG FIRST: {text}\n" for text in notes.troubles)
