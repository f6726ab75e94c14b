"""One scan with its devices, from opening them to the last reading; errors name how to resume."""

from __future__ import annotations

from contextlib import closing
from datetime import datetime
from functools import partial

from acquisition.engine.engine import Devices, Engine
from acquisition.engine.event_log import EventLogHandler, log_to_record
from acquisition.engine.pause import PauseSwitch
from acquisition.engine.resume import Progress
from acquisition.live.channel import channel_of
from acquisition.live.publisher import Publisher
from acquisition.live.watched_scan import buttons, seen_of, state_of
from acquisition.plan.plan import Plan, Step
from acquisition.rig import open_devices
from acquisition.terminal import stop_signals
from acquisition.terminal.console import console, duration_text, warnings_shown
from acquisition.terminal.orderly_end import orderly_end
from acquisition.terminal.pause_key import pause_key
from acquisition.terminal.progress import scan_progress
from acquisition.terminal.stop_thread import stopped_by_signals
from instrument.clock import Clock, SystemClock
from instrument.config.load import Loaded
from instrument.errors import DeviceError, Interlock, OperatorStop, StorageError, WrongRigFile
from instrument.record.event_kinds import FAULT, FINISHED, INTERLOCK, STOPPED
from instrument.record.record import FILE_NAME, Record

# Loggers of what a person can help with: a record or a camera that is waited for, an exposure, an
# axis that is not where it was.
_TO_BE_SEEN = (
    "instrument.record",
    "acquisition.interlocks",
    "acquisition.engine.retrying_camera",
    "acquisition.engine.exposure.check",
    "acquisition.engine.resume",
)
_LAST_WRITES_S = 5.0  # for a disk that hangs, or another program that holds the record


def scan(loaded: Loaded, plan: Plan, record: Record, progress: Progress | None = None) -> None:
    """Run the plan, or what is missing of it; the caller has claimed the run.

    Raises `OperatorStop`, `DeviceError` or `StorageError` with the command that resumes the scan.
    """
    clock: Clock = SystemClock()
    with log_to_record(record) as log, warnings_shown(*_TO_BE_SEEN):
        try:
            with orderly_end(), closing(open_devices(loaded)) as devices:
                clock = devices.clock
                _run(loaded, plan, record, progress, devices, log)
        except (KeyboardInterrupt, OperatorStop) as stop:
            why = str(stop) or "stopped by the operator"
            _record_end(record, log, clock, STOPPED, why)
            ended = "" if log.troubles else ": all motion has ended."
            raise OperatorStop(f"{why}{ended} {_how_to_go_on(record, log)}") from None
        except (DeviceError, StorageError) as error:
            for kind in (INTERLOCK, FAULT) if isinstance(error, Interlock) else (FAULT,):
                _record_end(record, log, clock, kind, str(error))
            rest = _how_to_go_on(record, log, resume=not isinstance(error, WrongRigFile))
            raise type(error)(f"{error}\n{rest}") from error
        except Exception as error:
            _record_end(record, log, clock, FAULT, f"the program failed: {error!r}")
            raise


def _run(
    loaded: Loaded,
    plan: Plan,
    record: Record,
    progress: Progress | None,
    devices: Devices,
    log: EventLogHandler,
) -> None:
    clock, before = devices.clock, progress or Progress()
    begun_s = clock.now_s() - before.elapsed_s
    console.print(
        f"{loaded.protocol.name}: {_extent(loaded, plan)} on the rig ({loaded.rig.name}), into "
        f"{record.folder}",
        highlight=False,
        soft_wrap=True,
    )
    with scan_progress(plan, before.done) as show:

        def on_step(step: Step) -> None:
            log.write()
            show(step)

        stops = {name: axis.stop for name, axis in devices.axes.items() if not axis.by_hand}
        switch = PauseSwitch(lambda text: console.print(text, highlight=False, soft_wrap=True))
        publisher = Publisher(channel_of(record.folder / FILE_NAME), loaded.rig.camera)
        engine = Engine(
            loaded.protocol,
            loaded.rig,
            devices,
            record,
            on_step,
            on_frames=lambda exposed, window: publisher.show(seen_of(exposed, window)),
            pause=switch,
        )
        state = partial(state_of, engine.present, devices.axes)
        follow = buttons(switch, engine.present, stop_signals.stop)
        with stopped_by_signals(stops), publisher.published(state, follow), pause_key(switch):
            engine.run(plan, progress)
    log.write()
    record_finished(record, plan, clock.utc())
    record.set_meta("scan_s", f"{clock.now_s() - begun_s:.1f}")
    record.set_meta("finished_utc", clock.utc().isoformat(timespec="seconds"))
    console.print(_warnings(log), end="", highlight=False, soft_wrap=True)


def _extent(loaded: Loaded, plan: Plan) -> str:
    """Return how much there is to measure: the geometries, or the goal that ends the scan."""
    if plan.choosing is None:
        return f"{len(plan.points)} geometries, about {duration_text(plan.duration_s)}"
    goal = ", ".join(f"u({n}) {g.u:g}" for n, g in (loaded.protocol.goal or {}).items())
    budget = loaded.protocol.budget_min
    limit = "" if budget is None else f", at most {budget:g} min"
    return f"until {goal}{limit}, of {len(plan.points)} geometries"


def record_finished(record: Record, plan: Plan, now: datetime) -> None:
    """Record that all steps are measured; of a scan that chose them, how many they are."""
    record.add_event(now.isoformat(), FINISHED, f"{len(plan.known)} steps")
    if plan.choosing is not None:
        record.set_meta("steps", str(len(plan.known)))


def _record_end(record: Record, log: EventLogHandler, clock: Clock, kind: str, why: str) -> None:
    """Record why a scan ended, unless the disk fails: the error message says it as well."""
    record.writing.give_up_within(_LAST_WRITES_S)
    try:
        log.write()
        record.add_event(clock.utc().isoformat(), kind, why)
    except StorageError:
        return


def _how_to_go_on(record: Record, log: EventLogHandler, *, resume: bool = True) -> str:
    """Return the state of the rig, the readings that are safe, and the command to continue with.

    Without `resume` the run cannot be continued: it keeps the rig file that was wrong.
    """
    folder = record.current_folder()
    if folder is None:
        return f"{_warnings(log)}The run's folder is gone: nothing is left to resume"
    safe = f"{_safe_readings(record)} in {folder}"
    new_run = "Correct the rig file, then start a new run"
    return f"{_warnings(log)}{safe}. {f'Go on with: gonio resume {folder}' if resume else new_run}"


def _safe_readings(record: Record) -> str:
    try:
        return f"{len(record.readings())} readings are safe"
    except StorageError as error:
        return f"{error}. Every other accepted reading is safe"


def _warnings(log: EventLogHandler) -> str:
    """Return one line for each trouble that a person must look at, empty if there is none."""
    return "".join(f"LOOK AT THE RIG FIRST: {text}\n" for text in log.troubles)
