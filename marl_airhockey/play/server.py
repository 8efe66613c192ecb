"""Web server of a session: one page, one WebSocket, and a check of who may connect."""

from __future__ import annotations

import asyncio
import contextlib
import secrets
import signal
import socket
from collections.abc import AsyncIterator
from pathlib import Path
from urllib.parse import urlsplit

import uvicorn
from starlette.applications import Starlette
from starlette.requests import HTTPConnection, Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import BaseRoute, Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect

from marl_airhockey.play.client import Client
from marl_airhockey.play.protocol import LARGEST
from marl_airhockey.play.real_match import RealMatch
from marl_airhockey.play.replay import replay_of
from marl_airhockey.play.session import Session

WEB = Path(__file__).parent / "web"
LOOPBACK = ("127.0.0.1", "localhost", "[::1]", "::1")
STALLED = 10.0
"""Time after which a page that takes no frame is disconnected, s."""
MAX_CLIENTS = 200
"""Most pages at once."""
CONTENT_SECURITY_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)


class AccessCheck:
    """Check of requests: our own pages alone, other machines only with the token.

    Args:
        host: address that the server listens at.
    """

    def __init__(self, host: str) -> None:
        self.local = host in LOOPBACK
        self.token = "" if self.local else secrets.token_urlsafe(12)

    def refusal(self, request: HTTPConnection) -> str | None:
        """Return the reason to refuse a request; None to accept it."""
        name = request.headers.get("host", "")
        # Without a token, a foreign page must not reach us under a name of its own.
        if self.local and _hostname(name) not in LOOPBACK:
            return "open the address that airhockey play printed"
        origin = request.headers.get("origin")
        if origin is not None and urlsplit(origin).netloc != name:
            return "another site's page may not connect"
        given = request.query_params.get("token", "")
        if self.token and not secrets.compare_digest(given, self.token):
            return "the link lacks its token: open the whole address"
        return None


def _hostname(host: str) -> str:
    return urlsplit(f"//{host}").hostname or ""


def _page(access: AccessCheck, mode: str, *routes: BaseRoute) -> list[BaseRoute]:
    """Return the routes of the page in a mode, "live" or "replay", and further ones."""

    async def page(request: Request) -> Response:
        reason = access.refusal(request)
        if reason is not None:
            return PlainTextResponse(reason + "\n", 403)
        return FileResponse(
            WEB / "page.html",
            headers={"Content-Security-Policy": CONTENT_SECURITY_POLICY},
        )

    async def mode_of_page(_: Request) -> Response:
        return JSONResponse({"mode": mode})

    files = Mount("/web", StaticFiles(directory=WEB))
    return [Route("/", page), Route("/mode", mode_of_page), *routes, files]


def replay(path: Path, access: AccessCheck) -> Starlette:
    """Return the web application that shows a recording.

    Raises:
        ValueError: no recording, or one without steps.
    """
    recording = replay_of(path)

    async def send_recording(request: Request) -> Response:
        reason = access.refusal(request)
        if reason is not None:
            return PlainTextResponse(reason + "\n", 403)
        return JSONResponse(recording)

    return Starlette(
        routes=_page(access, "replay", Route("/recording", send_recording))
    )


def application(session: Session, access: AccessCheck) -> Starlette:
    """Return the web application of a session, whose loop runs as long as it does."""

    @contextlib.asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        loop = asyncio.create_task(session.run())
        loop.add_done_callback(lambda task: _note_failure(session, task))
        yield
        loop.cancel()
        if session.host.recorder is not None:
            session.host.recorder.end(session.match, "the server was stopped")
        session.match.close()

    async def connection(socket: WebSocket) -> None:
        reason = access.refusal(socket)
        if reason is not None:
            await socket.close(1008, reason)
            return
        if len(session.clients) >= MAX_CLIENTS:
            await socket.close(1013, "too many are watching")
            return
        await socket.accept()
        peer = socket.client.host if socket.client else ""
        client = session.connect(remote=peer not in LOOPBACK)
        writer = asyncio.create_task(_write(socket, session, client))
        try:
            while (message := await socket.receive())["type"] == "websocket.receive":
                session.receive(client, message.get("text") or "")
        except ValueError as error:
            with contextlib.suppress(RuntimeError):
                await socket.close(1008, str(error)[:120])
        finally:
            session.disconnect(client)
            writer.cancel()

    async def picture(request: Request) -> Response:
        reason = access.refusal(request)
        if reason is not None:
            return PlainTextResponse(reason + "\n", 403)
        if not isinstance(session.match, RealMatch):
            return PlainTextResponse("there is no camera\n", 404)
        try:
            packed = await asyncio.to_thread(session.match.picture)
        except RuntimeError as error:
            return PlainTextResponse(f"{error}\n", 503)
        return Response(packed, media_type="image/jpeg")

    async def video(socket: WebSocket) -> None:
        """Send the table from above, each picture when the last one was drawn."""
        match, reason = session.match, access.refusal(socket)
        if reason is not None or not isinstance(match, RealMatch):
            await socket.close(1008, reason or "there is no camera")
            return
        await socket.accept()
        number = -1
        with contextlib.suppress(WebSocketDisconnect, RuntimeError, TimeoutError):
            while True:
                taken = await asyncio.to_thread(match.live_picture, number)
                if taken is None:
                    await socket.send_bytes(b"")
                else:
                    number = taken[0]
                    await socket.send_bytes(taken[2])
                await asyncio.wait_for(socket.receive_text(), STALLED)
                if taken is not None:
                    match.note_drawn(taken[1])
        match.drawn_after.clear()

    own = (
        WebSocketRoute("/ws", connection),
        WebSocketRoute("/video", video),
        Route("/camera", picture),
    )
    return Starlette(routes=_page(access, "live", *own), lifespan=lifespan)


def _note_failure(session: Session, task: asyncio.Task[None]) -> None:
    """Stop the server when the loop has failed: nobody plays at a dead table."""
    if not task.cancelled():
        session.failure = task.exception()
        signal.raise_signal(signal.SIGINT)


async def _write(socket: WebSocket, session: Session, client: Client) -> None:
    """Send a page the newest frame whenever the last one has been sent."""
    try:
        await socket.send_json({"t": "match", **session.describe()})
        while True:
            await client.frame_ready.wait()
            client.frame_ready.clear()
            await asyncio.wait_for(socket.send_text(client.frame), STALLED)
    except (WebSocketDisconnect, RuntimeError, TimeoutError):
        with contextlib.suppress(RuntimeError):
            await socket.close(1001)


def listen(host: str, port: int) -> socket.socket:
    """Return a listening TCP socket.

    Raises:
        ValueError: an address that is taken or not ours.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # With the protocol named, asyncio sets TCP_NODELAY: Nagle's algorithm would delay
    # each frame until the page has acknowledged the last one.
    server = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        server.bind((host, port))
        # Connections that come before the server runs wait for it.
        server.listen()
    except OSError as error:
        server.close()
        raise ValueError(f"--host {host} --port {port}: {error.strerror}") from error
    return server


def serve(app: Starlette, server: socket.socket) -> None:
    """Serve an application at a listening socket until interrupted."""
    config = uvicorn.Config(
        app,
        log_level="error",
        lifespan="on",
        ws_max_size=4 * LARGEST,
        ws_per_message_deflate=False,
        ws_ping_interval=10.0,
        ws_ping_timeout=20.0,
        timeout_graceful_shutdown=1,
    )
    with contextlib.suppress(KeyboardInterrupt):
        uvicorn.Server(config).run(sockets=[server])
