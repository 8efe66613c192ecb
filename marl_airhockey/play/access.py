"""Access to a server: checks of requests, and security headers for browsers."""

from __future__ import annotations

import secrets
from urllib.parse import urlsplit

from starlette.datastructures import MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

LOOPBACK = ("127.0.0.1", "localhost", "::1")
FORWARDED = ("forwarded", "via", "x-forwarded-for", "x-real-ip")
"""Headers that a proxy adds to a request that it forwards."""
HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; "
        "img-src 'self' data:; connect-src 'self'; base-uri 'none'; "
        "form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    # The address contains the token.
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=()",
    # One request per connection, because the time until a second one is not limited.
    "Connection": "close",
}
"""Headers of all responses."""


class AccessCheck:
    """Check of requests: only pages of this server, other machines only with a token.

    Args:
        host: Address at which the server listens.
        guarded: True if pages on this machine need the token, too, because a real arm
            moves.
    """

    def __init__(self, host: str, guarded: bool = False) -> None:
        self.local = host in LOOPBACK
        needed = guarded or not self.local
        self.token = secrets.token_urlsafe(12) if needed else ""
        self.link = ""
        """Address of the page with the token."""

    def is_remote(self, request: HTTPConnection) -> bool:
        """Return False only for a request of a page on this machine without a proxy.

        All requests behind a proxy come from the address of the proxy. A proxy is
        recognized by the original ``Host`` or by a header in `FORWARDED`.
        """
        peer = request.client.host if request.client else ""
        name = urlsplit(f"//{request.headers.get('host', '')}").hostname
        forwarded = any(header in request.headers for header in FORWARDED)
        return forwarded or peer not in LOOPBACK or name not in LOOPBACK

    def refusal(self, request: HTTPConnection) -> Response | None:
        """Return the response that rejects a request; None to accept the request."""
        host = request.headers.get("host", "")
        origin = request.headers.get("origin")
        try:
            name = urlsplit(f"//{host}").hostname or ""
            site = host if origin is None else urlsplit(origin).netloc
        except ValueError:
            return _refuse("Host or Origin is not a valid address", 400)
        # Without a token, a page of another site must not connect by another host name.
        if self.local and name not in LOOPBACK:
            return _refuse("open the address that airhockey play printed")
        if site != host:
            return _refuse("pages of other sites cannot connect")
        given = request.query_params.get("token", "").encode()
        if self.token and not secrets.compare_digest(given, self.token.encode()):
            return _refuse("the token is missing in the link: open the whole address")
        return None


def _refuse(reason: str, status: int = 403) -> Response:
    return PlainTextResponse(reason + "\n", status)


class SecurityHeaders:
    """Application that adds `HEADERS` to the responses of another application.

    Args:
        app: Other application.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(HEADERS)
            await send(message)

        await self.app(scope, receive, send_with_headers)
