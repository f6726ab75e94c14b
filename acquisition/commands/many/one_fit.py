"""Fit of one source among many, in a process of this computer or of a cluster."""

from __future__ import annotations

import contextlib
import threading
from pathlib import Path

from acquisition.batch.summary import Outcome
from acquisition.commands.fit import Asked, fit_of, report_files
from acquisition.commands.fit_status import require_result
from analysis.choice.fit_json import no_fit_json
from instrument.errors import GonioError, NotDetermined, StorageError

# A Dask worker may have several threads, and filters of warnings belong to the whole process.
_ONE_AT_A_TIME = threading.Lock()


def fit_one(named: tuple[str, Path], asked: Asked, report: bool) -> Outcome:
    """Fit a source, given by name and path, as `gonio fit` does; no error leaves this function.

    `report`: make the files of `gonio fit --out`.
    """
    name, path = named
    with _ONE_AT_A_TIME:
        try:
            return _fit_one(name, path, asked, report)
        except NotDetermined as error:
            found = no_fit_json(error)
            return Outcome(source=name, exit_code=error.exit_code, message=str(error), fit=found)
        except GonioError as error:
            return Outcome(source=name, exit_code=error.exit_code, message=str(error))
        except (OSError, MemoryError) as error:
            words = f"{type(error).__name__}: {error}"
            return Outcome(source=name, exit_code=StorageError.exit_code, message=words)
        except Exception as error:  # noqa: BLE001 - it is told, and the other sources are fitted
            words = f"fault of the program: {type(error).__name__}: {error}; see gonio fit {path}"
            return Outcome(source=name, exit_code=GonioError.exit_code, message=words)


def _fit_one(name: str, path: Path, asked: Asked, report: bool) -> Outcome:
    fitted = fit_of(path, asked, lambda _: contextlib.nullcontext())
    files = report_files(path, fitted) if report else {}
    code, message = 0, ""
    try:
        require_result(fitted.json, name)
    except NotDetermined as error:
        code, message = error.exit_code, str(fitted.json["reason"])
    return Outcome(source=name, exit_code=code, message=message, fit=fitted.json, files=files)
