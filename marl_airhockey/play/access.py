"""Access to a server: who may connect, and what browsers may do with its pages."""

from __future__ import annotations

import secrets
from urllib.parse import urlsplit

from starlette.datastructures import MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

LOOPBACK = ("127.0.0.1", "localhost", "::1")
FORWARDED = ("forwarded", "via", "x-forwarded-for", "x-real-ip")
"""Headers by which a proxy says that a request is not its own"""
HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; "
        "img-src 'self' data:; connect-src 'self'; base-uri 'none'; "
        "form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    # The address has the token in it.
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=()",
    # One request of a connection: nothing limits the time until a second one.
    "Connection": "close",
}
"""Headers of all answers"""


class AccessCheck:
    """Check of requests: our own pages alone, other machines only with the token.

    Args:
        host: Address that the server listens at.
        guarded: Whether pages of this machine need the token, too: a real arm moves.
    """

    def __init__(self, host: str, guarded: bool = False) -> None:
        self.local = host in LOOPBACK
        needed = guarded or not self.local
        self.token = secrets.token_urlsafe(12) if needed else ""

    def is_remote(self, request: HTTPConnection) -> bool:
        """Return True unless a page of this machine itself sends a request.

        Behind a proxy all come from the proxy's address. One that passes the original
        ``Host``, or any of `FORWARDED`, is known by that.
        """
        peer = request.client.host if request.client else ""
        name = urlsplit(f"//{request.headers.get('host', '')}").hostname
        forwarded = any(header in request.headers for header in FORWARDED)
        return forwarded or peer not in LOOPBACK or name not in LOOPBACK

    def refusal(self, request: HTTPConnection) -> Response | None:
        """Return the answer to a request that is refused; None to accept it."""
        host = request.headers.get("host", "")
        origin = request.headers.get("origin")
        try:
            name = urlsplit(f"//{host}").hostname or ""
            site = host if origin is None else urlsplit(origin).netloc
        except ValueError:
            return _refuse("Host or Origin is no address", 400)
        # Without a token, a foreign page must not reach us under a name of its own.
        if self.local and name not in LOOPBACK:
            return _refuse("open the address that airhockey play printed")
        if site != host:
            return _refuse("another site's page may not connect")
        given = request.query_params.get("token", "").encode()
        if self.token and not secrets.compare_digest(given, self.token.encode()):
            return _refuse("the link lacks its token: open the whole address")
        return None


def _refuse(reason: str, status: int = 403) -> Response:
    return PlainTextResponse(reason + "\n", status)


class SecurityHeaders:
    """Application whose answers have `HEADERS`, too.

    Args:
        app: Application.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(HEADERS)
            await send(message)

        await self.app(scope, receive, send_with_headers)
