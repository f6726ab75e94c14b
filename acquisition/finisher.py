"""The waiting process of `acquisition.afterwards`: load, wait for the word, finish the run."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

from acquisition.afterwards import GO
from acquisition.commands.scan import report_run
from instrument.errors import GonioError
from instrument.text.terminal_safe import escape_control_characters

NEEDED = ("acquisition.results.finish", "matplotlib.figure", "matplotlib.backends.backend_svg")


def main() -> None:
    """Arguments: the run's folder, and `json` or `text`; ends at once when its input closes."""
    for name in NEEDED:
        importlib.import_module(name)
    if sys.stdin.readline() != GO:
        return
    try:
        report_run(Path(sys.argv[1]), sys.argv[2] == "json")
    except GonioError as error:
        sys.stderr.write(f"{escape_control_characters(str(error))}\n")
        sys.exit(error.exit_code)


if __name__ == "__main__":
    main()
