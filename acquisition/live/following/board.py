"""Board of messages for the browsers: the newest of each key, numbered by when it changed.

A browser that reads slowly is behind by a number and nothing else: nothing piles up for it. One
that comes later, or again, gets the same messages as one that was there from the beginning, each
in its newest form.
"""

from __future__ import annotations

import json
import secrets
import threading
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, NamedTuple

_MOST_STALE = 2  # entries in the order for each message, before it is cleared of replaced ones


Content = Mapping[str, Any] | None


class Message(NamedTuple):
    """Content of a key since change `number`, and the text of it as server-sent event."""

    number: int
    kind: str
    data: Content
    text: bytes


class Board:
    """Messages by key. Any thread may put, and any may read."""

    def __init__(self) -> None:
        self.boot = secrets.token_hex(4)
        self._lock = threading.Lock()
        self._newest: dict[str, Message] = {}
        self._order: list[tuple[int, str]] = []  # by number; replaced messages are still in it
        self._number = 0
        self._readers: list[Callable[[], None]] = []
        self._closed = False

    @property
    def number(self) -> int:
        """Number of the last change, 0 before the first."""
        return self._number

    @property
    def readers(self) -> int:
        """Number of browsers that are being told of changes."""
        return len(self._readers)

    @property
    def closed(self) -> bool:
        """True once nothing more will come."""
        return self._closed

    def put(self, key: str, kind: str, data: Content) -> None:
        """Set the content of a key; nothing happens if it is what it was."""
        with self._lock:
            before = self._newest.get(key)
            if before is not None and before.data == data:
                return
            self._number += 1
            text = _event_text(f"{self.boot}-{self._number}", kind, data)
            self._newest[key] = Message(self._number, kind, data, text)
            self._order.append((self._number, key))
            if len(self._order) > _MOST_STALE * len(self._newest) + 100:
                self._order = [(n, k) for n, k in self._order if self._newest[k].number == n]
            readers = tuple(self._readers)
        for tell in readers:
            tell()

    def after(self, number: int, most_bytes: int) -> list[Message]:
        """Return what changed after a number, in order: at least one, then up to a size."""
        with self._lock:
            found: list[Message] = []
            size = 0
            for n, key in self._order[bisect_right(self._order, (number, "\U0010ffff")) :]:
                message = self._newest[key]
                if message.number != n:
                    continue
                size += len(message.text)
                if found and size > most_bytes:
                    break
                found.append(message)
            return found

    def position(self, last_id: str | None) -> int | None:
        """Return the number in the id of a message, 0 without one, None if it is not of here."""
        if not last_id:
            return 0
        boot, _, number = last_id.partition("-")
        own = boot == self.boot and number.isascii() and number.isdigit() and len(number) < 16
        return int(number) if own and int(number) <= self._number else None

    @contextmanager
    def told(self, tell: Callable[[], None]) -> Iterator[None]:
        """Call `tell` after each change, in a `with` block, from any thread; it must not wait."""
        with self._lock:
            self._readers.append(tell)
        try:
            yield
        finally:
            with self._lock:
                self._readers.remove(tell)

    def close(self) -> None:
        """Say that nothing more will come; may be called twice."""
        self._closed = True
        for tell in tuple(self._readers):
            tell()


def _event_text(number: str, kind: str, data: Content) -> bytes:
    """Return a server-sent event (WHATWG HTML, section 9.2); JSON has no line end in it."""
    content = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    # A lone surrogate, as a damaged file name has, becomes the escape that JSON has for it.
    return f"id: {number}\nevent: {kind}\ndata: {content}\n\n".encode("utf-8", "backslashreplace")
