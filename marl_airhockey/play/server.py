"""Web application of a session or a recording, with one page and one WebSocket."""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import signal
import time
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import BaseRoute, Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect

from marl_airhockey.play.access import AccessCheck
from marl_airhockey.play.client import Client
from marl_airhockey.play.invitation import code_of, rows_of
from marl_airhockey.play.real_match import RealMatch
from marl_airhockey.play.replay import replay_of
from marl_airhockey.play.session import Session
from marl_airhockey.sim.contracts.palette import stylesheet

WEB = Path(__file__).parent / "web"
VERSION = hashlib.sha256(
    b"".join(path.read_bytes() for path in sorted(WEB.rglob("*.*")))
).hexdigest()[:12]
"""Version of the page, by which an open page notices a newer one."""
PALETTE = stylesheet()
"""Stylesheet with the colours of the table and of the seats."""
STALLED = 10.0
"""Time after which a page that does not receive a frame is disconnected, s."""
MAX_CLIENTS = 200
"""Largest number of connected pages."""
FULL = f"The table is full: {MAX_CLIENTS} pages are connected"


def _page(access: AccessCheck, mode: str, *routes: BaseRoute) -> list[BaseRoute]:
    """Return the routes of the page in a mode, "live" or "replay", and further ones."""

    async def page(request: Request) -> Response:
        return access.refusal(request) or FileResponse(WEB / "page.html")

    async def mode_of_page(_: Request) -> Response:
        return JSONResponse({"mode": mode})

    async def palette(_: Request) -> Response:
        return PlainTextResponse(PALETTE, media_type="text/css")

    files = Mount("/web", StaticFiles(directory=WEB))
    own = [Route("/", page), Route("/mode", mode_of_page)]
    return [*own, Route("/palette.css", palette), *routes, files]


def replay(path: Path, access: AccessCheck) -> Starlette:
    """Return the web application that shows a recording.

    Raises:
        ValueError: The path is not a recording, or it has no steps.
    """
    recording = replay_of(path)

    async def send_recording(request: Request) -> Response:
        return access.refusal(request) or JSONResponse(recording)

    return Starlette(
        routes=_page(access, "replay", Route("/recording", send_recording))
    )


def application(session: Session, access: AccessCheck) -> Starlette:
    """Return the web application of a session, which also runs the loop of ticks."""
    if not access.local:
        rows = rows_of(code_of(access.link))
        session.host.invitation = {"link": access.link, "code": rows}

    @contextlib.asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        loop = asyncio.create_task(session.run())
        loop.add_done_callback(lambda task: _note_failure(session, task))
        yield
        loop.cancel()
        if session.host.recorder is not None:
            session.host.recorder.end(session.match, "the server was stopped")
        session.host.close()

    async def connection(socket: WebSocket) -> None:
        if refusal := access.refusal(socket):
            await socket.close(1008, bytes(refusal.body).decode().strip())
            return
        if len(session.clients) >= MAX_CLIENTS:
            # Only an accepted connection can carry a reason.
            await socket.accept()
            await socket.close(1013, f"{FULL}.")
            return
        await socket.accept()
        client = session.connect(remote=access.is_remote(socket))
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
        if refusal := access.refusal(request):
            return refusal
        if not isinstance(session.match, RealMatch):
            return PlainTextResponse("there is no camera\n", 404)
        try:
            packed = await asyncio.to_thread(session.match.picture)
        except RuntimeError as error:
            return PlainTextResponse(f"{error}\n", 503)
        return Response(packed, media_type="image/jpeg")

    async def video(socket: WebSocket) -> None:
        """Send the table of a real match from above."""
        match = session.match
        if access.refusal(socket) or not isinstance(match, RealMatch):
            await socket.close(1008, "this match has no video")
            return
        await _stream(socket, match.live_picture, match.note_drawn)
        match.drawn_after.clear()

    async def scene(socket: WebSocket) -> None:
        """Send the 3D scene of a match with simulated arms."""
        images = session.host.scene
        if access.refusal(socket) or images is None:
            await socket.close(1008, "this match has no 3D scene")
            return
        await _stream(socket, images.newest)

    own = (
        WebSocketRoute("/ws", connection),
        WebSocketRoute("/video", video),
        WebSocketRoute("/scene", scene),
        Route("/camera", picture),
    )
    return Starlette(routes=_page(access, "live", *own), lifespan=lifespan)


async def _stream(
    socket: WebSocket,
    newest: Callable[[int], tuple[Any, ...] | None],
    note_drawn: Callable[[float], None] | None = None,
) -> None:
    """Send images to a page, each one after the page has drawn the last.

    Args:
        socket: Connection of the page.
        newest: Function of the number of the last image. It returns the number and the
            JPEG of the next one, with the time of its exposure between them if
            ``note_drawn`` is given. It returns None if no image arrives in time.
        note_drawn: Function of an exposure time, for an image that a page has drawn.
    """
    await socket.accept()
    number = -1
    with contextlib.suppress(WebSocketDisconnect, RuntimeError, TimeoutError):
        while True:
            taken = await asyncio.to_thread(newest, number)
            if taken is None:
                await socket.send_bytes(b"")
            else:
                number = taken[0]
                await socket.send_bytes(taken[-1])
            await asyncio.wait_for(socket.receive_text(), STALLED)
            if taken is not None and note_drawn is not None:
                note_drawn(taken[1])


def _note_failure(session: Session, task: asyncio.Task[None]) -> None:
    """Stop the server if the loop of ticks has failed."""
    if not task.cancelled():
        session.failure = task.exception()
        signal.raise_signal(signal.SIGINT)


async def _write(socket: WebSocket, session: Session, client: Client) -> None:
    """Send the newest frame to a page whenever the last one has been sent."""
    try:
        edition = -1
        while True:
            await client.frame_ready.wait()
            client.frame_ready.clear()
            if client.edition != session.host.edition:
                continue  # A frame of the last game.
            if edition != client.edition:
                edition = client.edition
                described = {"t": "match", "version": VERSION, **session.describe()}
                await socket.send_json(described)
            number, now = client.frame_number, time.monotonic()
            if client.link.is_due(number, now):
                client.link.note_sent(number, now)
                client.events = []
                async with asyncio.timeout(STALLED):
                    await socket.send_text(client.frame)
    except (WebSocketDisconnect, RuntimeError, TimeoutError):
        with contextlib.suppress(RuntimeError):
            await socket.close(1001)
