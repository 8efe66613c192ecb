"""The web server of a session: one page, one WebSocket, and who may come in."""

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

from marl_airhockey.evaluation.recordings import read
from marl_airhockey.play.protocol import LARGEST
from marl_airhockey.play.session import Guest, Session

WEB = Path(__file__).parent / "web"
LOOPBACK = ("127.0.0.1", "localhost", "[::1]", "::1")
STALLED = 10.0
"""s after which a page that takes no frame is cut off."""
MOST = 200
"""Pages at once."""
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)


class Door:
    """Lets in pages of our own, and from other machines only with the token."""

    def __init__(self, host: str) -> None:
        self.local = host in LOOPBACK
        self.token = "" if self.local else secrets.token_urlsafe(12)

    def refuses(self, request: HTTPConnection) -> str | None:
        """Why a request is not let in, if it is not."""
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


def _page(door: Door, mode: str, *routes: BaseRoute) -> list[BaseRoute]:
    """The routes of the page in a mode, "live" or "replay", and others of its."""

    async def page(request: Request) -> Response:
        reason = door.refuses(request)
        if reason is not None:
            return PlainTextResponse(reason + "\n", 403)
        return FileResponse(
            WEB / "page.html", headers={"Content-Security-Policy": POLICY}
        )

    async def say_mode(_: Request) -> Response:
        return JSONResponse({"mode": mode})

    files = Mount("/web", StaticFiles(directory=WEB))
    return [Route("/", page), Route("/mode", say_mode), *routes, files]


def replay(path: Path, door: Door) -> Starlette:
    """The web application that shows a recording.

    Raises:
        ValueError: no recording.
    """
    meta, steps, end = read(path)
    if not steps:
        raise ValueError(f"{path}: there are no steps in it")
    recording = {"meta": meta, "steps": steps, "end": end}

    async def give(request: Request) -> Response:
        reason = door.refuses(request)
        if reason is not None:
            return PlainTextResponse(reason + "\n", 403)
        return JSONResponse(recording)

    return Starlette(routes=_page(door, "replay", Route("/recording", give)))


def application(session: Session, door: Door) -> Starlette:
    """The web application of a session; its court ticks while the application lives."""

    @contextlib.asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        loop = asyncio.create_task(session.run())
        loop.add_done_callback(lambda task: _note_failure(session, task))
        yield
        loop.cancel()
        if session.recorder is not None:
            session.recorder.end(session.court, "the server was stopped")
        session.court.close()

    async def talk(socket: WebSocket) -> None:
        reason = door.refuses(socket)
        if reason is not None:
            await socket.close(1008, reason)
            return
        if len(session.guests) >= MOST:
            await socket.close(1013, "too many are watching")
            return
        await socket.accept()
        guest = session.join()
        writer = asyncio.create_task(_write(socket, session, guest))
        try:
            while (message := await socket.receive())["type"] == "websocket.receive":
                session.hear(guest, message.get("text") or "")
        except ValueError as error:
            with contextlib.suppress(RuntimeError):
                await socket.close(1008, str(error)[:120])
        finally:
            session.part(guest)
            writer.cancel()

    routes = _page(door, "live", WebSocketRoute("/ws", talk))
    return Starlette(routes=routes, lifespan=lifespan)


def _note_failure(session: Session, task: asyncio.Task[None]) -> None:
    """A loop that dies takes the server with it: nobody plays at a dead table."""
    if not task.cancelled():
        session.failure = task.exception()
        signal.raise_signal(signal.SIGINT)


async def _write(socket: WebSocket, session: Session, guest: Guest) -> None:
    """Send a guest the newest frame whenever the last one is through."""
    try:
        await socket.send_json({"t": "court", **session.describe()})
        while True:
            await guest.news.wait()
            guest.news.clear()
            await asyncio.wait_for(socket.send_text(guest.frame), STALLED)
    except (WebSocketDisconnect, RuntimeError, TimeoutError):
        with contextlib.suppress(RuntimeError):
            await socket.close(1001)


def listen(host: str, port: int) -> socket.socket:
    """A listening socket.

    Raises:
        ValueError: an address that is taken or not ours.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # Said to be TCP, so that asyncio turns Nagle's algorithm off: it would hold each
    # frame back until the page has acknowledged the last one.
    server = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        server.bind((host, port))
        # Whoever is there before the server runs waits for it.
        server.listen()
    except OSError as error:
        server.close()
        raise ValueError(f"--host {host} --port {port}: {error.strerror}") from error
    return server


def serve(app: Starlette, server: socket.socket) -> None:
    """Serve until interrupted."""
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
