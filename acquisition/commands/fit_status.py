"""Exit codes of the verdicts, alike for `run`, `resume`, `report` and `fit`."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from instrument.errors import AllFlagged, NotDetermined


def require_result(fit: Mapping[str, object], source: str) -> None:
    """Raise for a fit, as in fit.json, that determines nothing; `source` opens the message.

    `AllFlagged` where there was nothing to fit, `NotDetermined` where no model could be fitted or
    the data do not determine the parameters of the chosen one.
    """
    if fit["verdict"] is None:
        raise AllFlagged(f"{source}: {fit['reason']}")
    if fit["verdict"] == "not identifiable" or fit["chosen"] is None:
        raise NotDetermined(f"{source}: {fit['reason']}")


@contextmanager
def no_fit_reported(source: Path, as_json: bool) -> Iterator[None]:
    """Print the JSON of a fit that was not possible, and name the source in the error."""
    try:
        yield
    except NotDetermined as error:
        if as_json:
            from analysis.choice.fit_json import no_fit_json  # heavy: loads every model

            print_json(no_fit_json(error))
        raise type(error)(f"{source}: {error}") from None


def print_json(fit: Mapping[str, object]) -> None:
    """Print a fit as one line of JSON on standard output."""
    sys.stdout.write(json.dumps(fit, allow_nan=False) + "\n")
