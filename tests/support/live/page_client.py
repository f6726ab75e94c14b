"""Browser without a window: asks the live page and reads its events."""

from __future__ import annotations

import http.client
import json
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Self
from urllib.parse import urlsplit

DEADLINE_S = 60.0


@dataclass
class Answer:
    """Status, headers by lower-case name, and body of an answer."""

    status: int
    headers: dict[str, str]
    body: bytes

    @property
    def text(self) -> str:
        return self.body.decode()


def ask(
    address: str, path: str, method: str = "GET", headers: dict[str, str] | None = None
) -> Answer:
    """Ask the page once, with the token of its address unless the path has one."""
    parts = urlsplit(address)
    line = http.client.HTTPConnection(parts.hostname or "", parts.port, timeout=DEADLINE_S)
    line.request(method, path, headers=headers or {})
    answer = line.getresponse()
    found = {name.lower(): value for name, value in answer.getheaders()}
    body = answer.read()
    line.close()
    return Answer(answer.status, found, body)


def with_token(address: str, path: str) -> str:
    """Return a path with the token of the page's address."""
    return f"{path}?{urlsplit(address).query}"


def post(address: str, action: str) -> Answer:
    """Ask for an action, as the page's buttons do."""
    token = urlsplit(address).query.removeprefix("token=")
    return ask(address, f"/actions/{action}", "POST", {"X-Gonio-Token": token})


@dataclass
class Browser:
    """Open stream of events; `shown` is the newest content by kind and key, `ids` all that came."""

    address: str
    last_id: str | None = None
    shown: dict[tuple[str, Any], Any] = field(default_factory=dict)
    ids: list[str] = field(default_factory=list)
    kinds: list[str] = field(default_factory=list)

    def __enter__(self) -> Self:
        parts = urlsplit(self.address)
        self._line = http.client.HTTPConnection(
            parts.hostname or "", parts.port, timeout=DEADLINE_S
        )
        headers = {"Last-Event-ID": self.last_id} if self.last_id else {}
        self._line.request("GET", f"/events?{parts.query}", headers=headers)
        self._answer = self._line.getresponse()
        assert self._answer.status == 200, self._answer.read()
        return self

    def __exit__(self, *_: object) -> None:
        self._answer.close()
        self._line.close()

    def read_until(self, done: Callable[[Browser], bool]) -> None:
        """Read events until they are what is waited for."""
        end_s = time.monotonic() + DEADLINE_S
        while not done(self):
            assert time.monotonic() < end_s, self.shown
            assert self.read_event(), "the stream ended"

    def read_event(self) -> bool:
        """Read one event, or a line of comment; False at the end."""
        lines = []
        while (line := self._answer.readline().decode()) not in ("\n", ""):
            lines.append(line.rstrip("\n"))
        return self._take(dict(text.split(": ", 1) for text in lines if ": " in text)) or bool(line)

    def _take(self, event: dict[str, str]) -> bool:
        if "event" not in event:
            return False
        kind, data = event["event"], json.loads(event["data"])
        self.kinds.append(kind)
        if "id" in event:
            self.ids.append(event["id"])
        own = data.get("step", data.get("number")) if kind in ("point", "happened") else ""
        self.shown[kind, own] = data
        return True

    def of(self, kind: str) -> Any:
        """The newest content of a kind that has one key, None before it came."""
        return self.shown.get((kind, ""))

    def points(self) -> dict[int, Any]:
        """The newest content of every point by its step."""
        return {key: data for (kind, key), data in self.shown.items() if kind == "point"}
