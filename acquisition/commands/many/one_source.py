"""Work on one source among many: whatever becomes of it is an outcome."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

from acquisition.batch.summary import Outcome
from instrument.errors import GonioError, StorageError

# A Dask worker may have several threads, and filters of warnings belong to the whole process.
_ONE_AT_A_TIME = threading.Lock()


def outcome_of(
    named: tuple[str, Path], command: str, work: Callable[[str, Path], Outcome]
) -> Outcome:
    """Return the outcome of work on a source, given by name and path; no error leaves this.

    command: that of `gonio` for the source alone, such as "fit".
    """
    name, path = named
    with _ONE_AT_A_TIME:
        try:
            return work(name, path)
        except GonioError as error:
            return Outcome(source=name, exit_code=error.exit_code, message=str(error))
        except (OSError, MemoryError) as error:
            words = f"{type(error).__name__}: {error}"
            return Outcome(source=name, exit_code=StorageError.exit_code, message=words)
        except Exception as error:  # noqa: BLE001 - it is told, and the other sources are worked on
            words = f"fault of the program: {type(error).__name__}: {error}"
            words += f"; see gonio {command} {path}"
            return Outcome(source=name, exit_code=GonioError.exit_code, message=words)
