"""Entry of the command `gonio`: signals first, then the imports of the command line."""

from __future__ import annotations

import sys

from acquisition.terminal import stop_signals
from instrument.errors import OperatorStop


def main() -> None:
    """Run the command line; a signal ends it with an exit code of the program at any moment."""
    stop_signals.begin()
    try:
        from acquisition.cli import main as run_command

        run_command()
    except SystemExit as end:
        stop_signals.ended(end.code if isinstance(end.code, int) else 0)
        raise
    except KeyboardInterrupt:
        sys.exit(OperatorStop.exit_code)
    stop_signals.ended(0)
