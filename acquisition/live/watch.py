"""Command `gonio watch`: the live page of a run, also one that has ended."""

from __future__ import annotations

import threading
from pathlib import Path

from acquisition.live.address import address, listening_socket, new_token
from acquisition.live.page_process import be_modest, require_libraries
from acquisition.terminal.console import out
from acquisition.terminal.orderly_end import orderly_end


def watch_run(folder: Path, port: int) -> None:
    """Serve the page of a run until Ctrl-C.

    Raises `InputError` or `StorageError` where the folder is no run, or one that cannot be read.
    """
    require_libraries()
    be_modest()
    from acquisition.live.live_page import LivePage

    token, listener = new_token(), listening_socket(port)
    try:
        with orderly_end(), LivePage(folder, listener, token):
            out.print(address(listener, token), highlight=False, soft_wrap=True)
            threading.Event().wait()
    except KeyboardInterrupt:
        return
