"""Server of the calibration's page: sends frames, receives clicks and orders."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path

from starlette.applications import Starlette
from starlette.requests import HTTPConnection, Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from marl_airhockey.lab.calibration.camera_session import CameraSession

WEB = Path(__file__).parent / "web"
LARGEST = 512
"""Largest size of an order, bytes"""
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Content security policy of the page"""


def application(
    session: CameraSession, refusal: Callable[[HTTPConnection], str | None]
) -> Starlette:
    """Return the web application of a calibration.

    Args:
        session: Session that carries out the orders.
        refusal: Function that returns the reason to refuse a request; None to accept.
    """

    async def page(request: Request) -> Response:
        headers = {"Content-Security-Policy": POLICY}
        return _refused(request) or FileResponse(WEB / "page.html", headers=headers)

    async def picture(request: Request) -> Response:
        refused = _refused(request)
        if refused is not None:
            return refused
        try:
            packed = await asyncio.to_thread(session.picture)
        except RuntimeError as error:
            return PlainTextResponse(f"{error}\n", 503)
        return Response(packed, media_type="image/jpeg")

    async def state(request: Request) -> Response:
        orders = [*session.orders]
        return _refused(request) or JSONResponse({**session.state(), "orders": orders})

    async def do(request: Request) -> Response:
        refused = _refused(request)
        if refused is not None:
            return refused
        if int(request.headers.get("content-length", LARGEST + 1)) > LARGEST:
            return PlainTextResponse(f"an order has at most {LARGEST} bytes\n", 413)
        try:
            given = await request.json()
            order, click = str(given.pop("do")), {k: float(v) for k, v in given.items()}
            await asyncio.to_thread(session.do, order, **click)
        except (ValueError, RuntimeError, KeyError, TypeError, AttributeError) as error:
            return JSONResponse({"error": str(error)}, 400)
        return JSONResponse(session.state())

    def _refused(request: Request) -> Response | None:
        reason = refusal(request)
        return None if reason is None else PlainTextResponse(reason + "\n", 403)

    routes = [
        Route("/", page),
        Route("/picture", picture),
        Route("/state", state),
        Route("/do", do, methods=["POST"]),
        Mount("/web", StaticFiles(directory=WEB)),
    ]
    return Starlette(routes=routes)
