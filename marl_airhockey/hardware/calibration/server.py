"""Server of the calibration's page, which sends frames and receives commands."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path

from starlette.applications import Starlette
from starlette.requests import HTTPConnection, Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from marl_airhockey.hardware.calibration.camera_session import CameraSession

WEB = Path(__file__).parent / "web"
LARGEST = 512
"""Largest size of a command, bytes."""


def application(
    session: CameraSession, refusal: Callable[[HTTPConnection], Response | None]
) -> Starlette:
    """Return the web application of a calibration.

    Args:
        session: Session that executes the commands.
        refusal: Function that returns the response to a request that is rejected, or
            None to accept it.
    """

    async def page(request: Request) -> Response:
        return refusal(request) or FileResponse(WEB / "page.html")

    async def picture(request: Request) -> Response:
        if refused := refusal(request):
            return refused
        try:
            packed = await asyncio.to_thread(session.picture)
        except RuntimeError as error:
            return PlainTextResponse(f"{error}\n", 503)
        return Response(packed, media_type="image/jpeg")

    async def state(request: Request) -> Response:
        orders = [*session.orders]
        return refusal(request) or JSONResponse({**session.state(), "orders": orders})

    async def do(request: Request) -> Response:
        if refused := refusal(request):
            return refused
        if int(request.headers.get("content-length", LARGEST + 1)) > LARGEST:
            return PlainTextResponse(f"a command has at most {LARGEST} bytes\n", 413)
        try:
            given = await request.json()
            order, click = str(given.pop("do")), {k: float(v) for k, v in given.items()}
            await asyncio.to_thread(session.do, order, **click)
        except (ValueError, RuntimeError, KeyError, TypeError, AttributeError) as error:
            return JSONResponse({"error": str(error)}, 400)
        return JSONResponse(session.state())

    routes = [
        Route("/", page),
        Route("/picture", picture),
        Route("/state", state),
        Route("/do", do, methods=["POST"]),
        Mount("/web", StaticFiles(directory=WEB)),
    ]
    return Starlette(routes=routes)
