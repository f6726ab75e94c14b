"""Server of the live page: uvicorn in a thread, at an address of this computer alone."""

from __future__ import annotations

import asyncio
import socket
import threading

import uvicorn
from starlette.types import ASGIApp

from instrument.closeable import Closeable

_MOST_CONNECTIONS = 64
_LAST_ANSWERS_S = 1.0  # for browsers that do not read, at the end
_MOST_S = 5  # after which uvicorn gives up, with a message


class _Server(uvicorn.Server):
    """Server that ends the connections of browsers that do not read, as well."""

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        impatient = asyncio.create_task(self._abort_later())
        await super().shutdown(sockets)
        impatient.cancel()

    async def _abort_later(self) -> None:
        await asyncio.sleep(_LAST_ANSWERS_S)
        for connection in tuple(self.server_state.connections):
            transport: asyncio.Transport = connection.transport
            transport.abort()


class WebServer(Closeable):
    """Server of an application at a socket that listens, which it closes at its end."""

    def __init__(self, app: ASGIApp, listener: socket.socket) -> None:
        config = uvicorn.Config(
            app,
            loop="asyncio",
            http="h11",
            ws="none",
            lifespan="off",
            log_config=None,
            access_log=False,  # it would hold the token
            proxy_headers=False,
            server_header=False,
            limit_concurrency=_MOST_CONNECTIONS,
            timeout_graceful_shutdown=_MOST_S,
        )
        self._server = _Server(config)
        self._thread = threading.Thread(
            target=self._server.run, args=([listener],), name="web", daemon=True
        )
        self._thread.start()

    def close(self) -> None:
        """End the server once its answers are sent, or cannot be; may be called twice."""
        self._server.should_exit = True
        self._thread.join()
