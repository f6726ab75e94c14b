"""Application of the live page: its addresses, and what each answers."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import FileResponse, PlainTextResponse, Response, StreamingResponse
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp

from acquisition.live.channel import ABORT, OK, PAUSE, RESUME, NoScanError, send
from acquisition.live.following.board import Board
from acquisition.live.following.run_reader import RunReader
from acquisition.live.web.door import Door
from acquisition.live.web.event_stream import event_stream
from acquisition.live.web.pictures import kept_picture, newest_picture

_ROOM = Path(__file__).parents[1]
PAGE, VENDOR = _ROOM / "page", _ROOM / "vendor"
_ACTIONS = (PAUSE, RESUME, ABORT)
_GONE = "This picture is not there any more."


@dataclass(frozen=True, slots=True)
class Shown:
    """Things that the page shows; without a run it is for aiming the camera."""

    board: Board
    channel: Path
    reader: RunReader | None


def live_app(shown: Shown, token: str, port: int) -> ASGIApp:
    """Return the application, behind its door."""
    answers = _Answers(shown)
    routes = [
        Route("/", answers.page),
        Route("/events", answers.events),
        Route("/pictures/{number:int}.jpg", answers.newest),
        Route("/frames/{step:int}.jpg", answers.kept),
        Route("/actions/{action}", answers.action, methods=["POST"]),
        Mount("/static", _static_files()),
    ]
    return Door(Starlette(routes=routes), token, port)


def _static_files() -> StaticFiles:
    files = StaticFiles()
    files.all_directories.extend((PAGE, VENDOR))
    return files


class _Answers:
    def __init__(self, shown: Shown) -> None:
        self._shown = shown

    async def page(self, _: Request) -> Response:
        return FileResponse(PAGE / "index.html")

    async def events(self, request: Request) -> Response:
        last_id = request.headers.get("last-event-id")
        stream = event_stream(self._shown.board, last_id)
        return StreamingResponse(stream, media_type="text/event-stream")

    async def newest(self, request: Request) -> Response:
        number = request.path_params["number"]
        return _jpeg(await run_in_threadpool(newest_picture, self._shown.channel, number))

    async def kept(self, request: Request) -> Response:
        reader, step = self._shown.reader, request.path_params["step"]
        data = None if reader is None else await run_in_threadpool(kept_picture, reader, step)
        return _jpeg(data)

    async def action(self, request: Request) -> Response:
        action = request.path_params["action"]
        if action not in _ACTIONS:
            return PlainTextResponse(f"No such action; there are {', '.join(_ACTIONS)}.\n", 404)
        answer = await run_in_threadpool(_answer, self._shown.channel, action)
        return Response(status_code=204) if answer == OK else PlainTextResponse(f"{answer}\n", 409)


def _answer(channel: Path, action: str) -> str:
    try:
        return send(channel, action)
    except NoScanError as error:
        return str(error)


def _jpeg(data: bytes | None) -> Response:
    if data is None:
        return PlainTextResponse(f"{_GONE}\n", 404)
    return Response(data, media_type="image/jpeg")
