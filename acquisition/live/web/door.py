"""Door of the live page: who may come in, and the headers that every answer carries.

Any program and any web page that the user opens can reach a port of this computer. The token in
the address keeps out other users and other pages; the check of Host keeps out a page that has its
own name point here (DNS rebinding), that of Origin a page that sends a request from elsewhere.
"""

from __future__ import annotations

import hmac

from starlette.datastructures import Headers, MutableHeaders, QueryParams
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

TOKEN_HEADER = "x-gonio-token"
STATIC = "/static/"
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
_HEADERS = {
    "Content-Security-Policy": _POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
}


class Door:
    """Application that lets in requests with the token, sent by this page or by no page."""

    def __init__(self, app: ASGIApp, token: str, port: int) -> None:
        self._app, self._token = app, token
        self._hosts = {f"127.0.0.1:{port}", f"localhost:{port}"}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or answer it with 403 and one line that says why."""

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(_HEADERS)
            await send(message)

        refusal = self._refusal(scope)
        app = PlainTextResponse(f"{refusal}\n", 403) if refusal else self._app
        await app(scope, receive, send_with_headers)

    def _refusal(self, scope: Scope) -> str:
        """Return why a request is refused, empty if it is not."""
        headers = Headers(scope=scope)
        if headers.getlist("host")[1:] or headers.get("host") not in self._hosts:
            return "This page is at the printed address only."
        if not set(headers.getlist("origin")) <= {f"http://{host}" for host in self._hosts}:
            return "Requests of other pages are refused."
        if not scope["path"].startswith(STATIC) and not self._is_token(_token_of(scope, headers)):
            return "The address lacks its token: open the printed one."
        return ""

    def _is_token(self, given: str) -> bool:
        return hmac.compare_digest(given.encode(), self._token.encode())


def _token_of(scope: Scope, headers: Headers) -> str:
    """Return the token of a request, empty without one: no other page can set a header."""
    if scope["method"] == "POST":
        return headers.get(TOKEN_HEADER, "")
    return QueryParams(scope["query_string"]).get("token", "")
