"""Address of a live page: a port of this computer alone, and a token that nobody can guess."""

from __future__ import annotations

import secrets
import socket

from instrument.errors import InputError

HOST = "127.0.0.1"


def listening_socket(port: int) -> socket.socket:
    """Return a socket that listens at a port, 0 for a free one; `InputError` if it is taken."""
    try:
        return socket.create_server((HOST, port))
    except (OSError, OverflowError) as error:
        raise InputError(
            f"--port {port}: {error}: name another port, 1024 to 65535, or 0 for a free one"
        ) from error


def new_token() -> str:
    """Return a token of 192 random bits."""
    return secrets.token_urlsafe(24)


def address(listener: socket.socket, token: str) -> str:
    """Return the address of the page at this socket."""
    return f"http://{HOST}:{port_of(listener)}/?token={token}"


def port_of(listener: socket.socket) -> int:
    """Return the port at which a socket listens."""
    port: int = listener.getsockname()[1]
    return port
