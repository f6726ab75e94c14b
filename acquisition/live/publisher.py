"""Publisher: what a running process shows to those who watch it, from a thread of its own.

While nobody watches, it does nothing but keep the newest frames. A thread that writes for a browser
must never end or delay a scan: what fails here is logged once.
"""

from __future__ import annotations

import json
import logging
import shutil
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

from acquisition.live.channel import (
    OK,
    PICTURE_FILE,
    SCAN_EVERY_S,
    SOCKET_FILE,
    STATE_FILE,
    WATCH,
    WATCH_EVERY_S,
    is_private,
    user_folder,
)
from acquisition.live.command_desk import CommandDesk
from acquisition.live.picture import jpeg_of, numbers_of
from acquisition.measure.window import Window
from instrument.config.camera import CameraConfig
from instrument.devices import Frame

log = logging.getLogger(__name__)

_WATCHED_S = 2.5 * WATCH_EVERY_S  # after a command `watch`

State = dict[str, Any]
"""Present state as it is published, see `watched_scan`; a number that is unknown is None."""


@dataclass(frozen=True, slots=True)
class Seen:
    """Newest frame to be shown, with its window; `about`: caption and other entries for it."""

    frame: Frame
    window: Window
    about: Mapping[str, object]


class Publisher:
    """Keeps the newest frame, and writes it with the present state while somebody watches.

    folder: that of the channel. camera: tells which counts are saturated. every_s: time between two
    publications; each costs a few ms of one core, and as much again in every browser.
    """

    def __init__(
        self, folder: Path, camera: CameraConfig, *, every_s: float = SCAN_EVERY_S
    ) -> None:
        self._folder, self._camera, self._every_s = folder, camera, every_s
        self._state: Callable[[], State] = dict
        self._seen: Seen | None = None
        self._written: Seen | None = None
        self._picture: dict[str, object] | None = None
        self._number = 0
        self._watched_until_s = 0.0
        self._wake, self._over = threading.Event(), threading.Event()

    @contextmanager
    def published(self, state: Callable[[], State], follow: Callable[[str], str]) -> Iterator[None]:
        """Publish the state that `state` returns, and follow commands, within a `with` block.

        `follow` carries out a command other than `watch`, and returns the answer. Where there can
        be no channel the reason is logged: nothing that is measured needs it.
        """
        self._state = state
        try:
            _make_folder(self._folder)
            desk = CommandDesk(self._folder / SOCKET_FILE, partial(self._answer, follow))
        except OSError as error:
            why = error.strerror or error
            log.warning("what is done here cannot be watched: %s: %s", self._folder, why)
            yield
            return
        thread = threading.Thread(target=self._run, name="live page", daemon=True)
        thread.start()
        try:
            with desk:
                yield
        finally:
            self._over.set()
            self._wake.set()
            thread.join()
            shutil.rmtree(self._folder, ignore_errors=True)

    def show(self, seen: Seen) -> None:
        """Show a frame next; one that has not been written yet is left out. From any thread."""
        self._seen = seen

    def _answer(self, follow: Callable[[str], str], command: str) -> str:
        if command != WATCH:
            return follow(command)
        self._watched_until_s = time.monotonic() + _WATCHED_S
        self._wake.set()
        return OK

    @property
    def _is_watched(self) -> bool:
        return time.monotonic() < self._watched_until_s

    def _run(self) -> None:
        try:
            while not self._over.is_set():
                if self._is_watched:
                    self._publish()
                    self._over.wait(self._every_s)
                else:
                    self._wake.clear()
                    self._wake.wait()
            if self._is_watched:
                self._publish()
        except OSError as error:
            log.warning("the live page is not kept up to date: %s", error)

    def _publish(self) -> None:
        seen = self._seen
        if seen is not None and seen is not self._written:
            _replace(self._folder / PICTURE_FILE, jpeg_of(seen.frame.image, self._camera.max_dn))
            self._number += 1
            numbers = asdict(numbers_of(seen.frame, seen.window, self._camera))
            self._picture = {"number": self._number, **seen.about, **numbers}
            self._written = seen
        state = {**self._state(), "time_utc": _now(), "picture": self._picture}
        _replace(self._folder / STATE_FILE, json.dumps(state).encode())


def _make_folder(folder: Path) -> None:
    """Make the folder anew; the lock of the run ensures that no other process uses it."""
    user_folder().mkdir(mode=0o700, exist_ok=True)
    if not is_private(user_folder()):
        raise PermissionError(f"{user_folder()} is open to others, or is not this user's")
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(mode=0o700)


def _replace(path: Path, content: bytes) -> None:
    part = path.with_suffix(".part")
    part.write_bytes(content)
    part.replace(path)


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds")
