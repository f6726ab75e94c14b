"""One command for all sources of a folder, by processes or a Dask cluster; `gonio ... --all`.

A source that fails ends no other, and a stop keeps what is done. What is done with a source, and
what is told of it, is the `Task` of the command.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from acquisition.batch.cluster import connected, on_cluster, worker_count
from acquisition.batch.found import Found, listed
from acquisition.batch.lost import Lost
from acquisition.batch.processes import cores, on_processes
from acquisition.batch.summary import Outcome, SomeFailed, as_json
from acquisition.commands.fit_status import print_json
from acquisition.terminal.console import console, out, print_lines, print_notes
from acquisition.terminal.layout import Row, table_lines
from acquisition.terminal.orderly_end import orderly_end
from acquisition.terminal.progress import counted_progress
from acquisition.terminal.stop_signals import reason
from instrument.errors import DeviceError, InputError, OperatorStop, StorageError

Named = tuple[str, Path]
Results = Generator[tuple[Named, Outcome | Lost], None, None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Many:
    """Request for many sources at once.

    workers: processes at a time, None for the cores that are there. scheduler: address of a Dask
    scheduler in place of processes.
    """

    workers: int | None = None
    scheduler: str | None = None
    as_json: bool = False

    def __post_init__(self) -> None:
        """Refuse options that contradict one another."""
        if self.workers is not None and self.scheduler is not None:
            raise InputError(
                "--workers: for processes of this computer; a cluster has its own workers"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """Part of a command that differs from those of other commands.

    work: makes the outcome of a source; a function of a module, or a `partial` of one. keep: writes
    its files, here, and returns the outcome to tell of. line: a result, in a line of a log. table:
    header and rows of the outcomes. finish: is called once with the sorted outcomes, before they
    are printed. result: name of a result in JSON, such as "fit". done: word of the counter, such as
    "fitted". others: what those of `Found` are, such as "not read, as neither run nor table".
    """

    work: Callable[[Named], Outcome]
    keep: Callable[[Outcome, Path], Outcome]
    line: Callable[[Outcome], str]
    table: Callable[[Sequence[Outcome]], tuple[Row, Sequence[Row]]]
    finish: Callable[[Sequence[Outcome]], None] = lambda _: None
    result: str
    done: str
    others: str


def for_each(found: Found, task: Task, many: Many) -> None:
    """Do the task for each source and print a table of the outcomes.

    Raises, after printing what is done, `SomeFailed` where some have no result, `OperatorStop`
    after a signal, and `DeviceError` where the scheduler is lost.
    """
    outcomes: list[Outcome] = []
    try:
        with orderly_end():
            _do_each(found, task, many, outcomes)
    except DeviceError:
        _end(found, task, many, outcomes)
        raise
    except KeyboardInterrupt:
        _end(found, task, many, outcomes)
        done = f"{len(outcomes)} of {len(found.sources)} done"
        raise OperatorStop(f"{reason() or 'stopped by the operator'}: {done}") from None
    _end(found, task, many, outcomes)
    if any(outcome.exit_code for outcome in outcomes):
        raise SomeFailed(sorted(outcomes, key=_order))


def _do_each(found: Found, task: Task, many: Many, outcomes: list[Outcome]) -> None:
    """Append the outcomes as they are done; write the files of each at once."""
    with (
        _results(found, task.work, many) as results,
        counted_progress(len(found.sources), task.done) as shown,
    ):
        for (name, _), result in results:
            outcome = _outcome(name, result)
            if outcome.files:
                outcome = replace(task.keep(outcome, found.sources[name]), files={})
            outcomes.append(outcome)
            shown(_line(outcome, task), bool(outcome.exit_code))


@contextmanager
def _results(found: Found, work: Callable[[Named], Outcome], many: Many) -> Iterator[Results]:
    """Outcomes as they are done; leaving the block ends the work on those that are not."""
    items = list(found.sources.items())
    if many.scheduler is None:
        with closing(on_processes(work, items, many.workers or cores())) as results:
            yield results
        return
    items = [(name, path.absolute()) for name, path in items]  # for workers in other folders
    with connected(many.scheduler) as client:
        if not worker_count(client):
            text = f"{many.scheduler} has no worker yet: dask worker {many.scheduler} --nthreads 1"
            console.print(text, highlight=False, soft_wrap=True)
        with closing(on_cluster(work, items, client)) as results:
            yield results


def _outcome(name: str, result: Outcome | Lost) -> Outcome:
    if isinstance(result, Lost):
        return Outcome(source=name, exit_code=StorageError.exit_code, message=result.reason)
    return result


def _line(outcome: Outcome, task: Task) -> str:
    return f"{outcome.source}: {outcome.reason if outcome.exit_code else task.line(outcome)}"


def _order(outcome: Outcome) -> str:
    return outcome.source


def _end(found: Found, task: Task, many: Many, outcomes: Sequence[Outcome]) -> None:
    """Finish with what is done, and print it."""
    done = sorted(outcomes, key=_order)
    if done:
        task.finish(done)
    if many.as_json:
        print_json(as_json(done, task.result, complete=len(done) == len(found.sources)))
        return
    if done:
        print_lines(table_lines(*task.table(done), out.width, right=False))
    print_notes(f"{outcome.source}: {outcome.reason}" for outcome in done if outcome.message)
    if found.others:
        print_notes([f"{task.others}: {listed(found.others)}"])
