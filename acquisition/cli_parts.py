"""Parts that all groups of commands share: options, and errors as exit codes."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer
from typer.core import TyperGroup

from instrument.errors import GonioError, InputError, OperatorStop, StorageError
from instrument.text.terminal_safe import escape_control_characters

_SHOWN = 80  # characters of a path that is too long
_MORE = "free memory, raise the limit (ulimit -v), or name less data; what is recorded stays"

Json = Annotated[
    bool, typer.Option("--json", help="Print only the result, as JSON, on standard output.")
]

ProtocolFile = Annotated[Path, typer.Argument(help="The protocol, a YAML file.")]

RigFile = Annotated[
    Path | None, typer.Option("--rig", help="A rig file in place of the one the protocol names.")
]

RunFolder = Annotated[Path, typer.Argument(help="The folder of a run.")]

Workers = Annotated[
    int | None,
    typer.Option(min=1, help="Processes for --all. Default: as many as there are cores."),
]

Scheduler = Annotated[
    str | None,
    typer.Option(help="Dask scheduler for --all in place of processes, as tcp://127.0.0.1:8786."),
]

RigOnly = Annotated[Path | None, typer.Option("--rig", help="The rig file.")]


def among(words: Sequence[str]) -> Callable[[str], list[str]]:
    """Completion in the shell among a few words."""
    return lambda incomplete: [word for word in words if word.startswith(incomplete)]


def model_names(incomplete: str) -> list[str]:
    """Completion in the shell of names of models, separated by commas."""
    from acquisition.commands.models import completed_names

    return completed_names(incomplete)


def refuse_without_all(workers: int | None, scheduler: str | None) -> None:
    """Raise `InputError` for an option of --all where that is not given."""
    for option, value in (("--workers", workers), ("--scheduler", scheduler)):
        if value is not None:
            raise InputError(f"{option}: for many sources at once; allowed with --all")


class Commands(TyperGroup):
    """Group whose commands end with an exit code of the program where they fail."""

    def invoke(self, ctx: Any) -> Any:
        """Run a command."""
        with errors_as_exit_codes():
            return super().invoke(ctx)


@contextmanager
def errors_as_exit_codes() -> Iterator[None]:
    """Print an expected error or a Ctrl-C on standard error and exit with its code."""
    try:
        yield
    except GonioError as error:
        _exit(str(error), error.exit_code)
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            _exit(_too_long(error), InputError.exit_code)
        _exit(str(error), StorageError.exit_code)
    except (MemoryError, ImportError, RuntimeError) as error:
        if not _is_memory(error):
            raise
        _exit(f"out of memory ({str(error) or 'no details'}): {_MORE}", StorageError.exit_code)
    except KeyboardInterrupt as stop:
        _exit(str(stop) or "stopped by the operator", OperatorStop.exit_code)


def _is_memory(error: Exception) -> bool:
    """Return True for an error of too little memory: of data, a library or a thread."""
    words = ("failed to map segment", "cannot allocate memory", "can't start new thread")
    return isinstance(error, MemoryError) or any(w in str(error).lower() for w in words)


def _too_long(error: OSError) -> str:
    """Return the message for a path that no file system takes, which is shown only in part."""
    path = os.fspath(error.filename) if error.filename is not None else ""
    name = path if isinstance(path, str) else os.fsdecode(path)
    return (
        f"{name[:_SHOWN]}...: too long ({len(os.fsencode(name))} bytes); allowed: names of up to "
        "255 bytes, together up to 4095: use a shorter one"
    )


def _exit(message: str, code: int) -> NoReturn:
    sys.stderr.write(f"{escape_control_characters(message)}\n")
    raise typer.Exit(code) from None
