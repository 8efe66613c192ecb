"""Commands ``airhockey calibrate`` and ``airhockey calibrate sheets``."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from marl_airhockey.cli import play as cli_play
from marl_airhockey.cli.options import console
from marl_airhockey.cli.progress import waiting
from marl_airhockey.hardware.camera import Camera, open_source
from marl_airhockey.hardware.vision.calibration import tag_corners
from marl_airhockey.sim.core.errors import require
from marl_airhockey.sim.core.table import TABLES
from marl_airhockey.types import Array

if TYPE_CHECKING:
    from marl_airhockey.hardware.calibration.hand_session import HandSession
    from marl_airhockey.hardware.lab.lab import LabClient

TOOL = (0.0, 0.0, 0.12, 0.0, 0.0, 0.0)
"""Pose of the paddle's foot in the flange's frame, m and rad"""

calibrate = typer.Typer(help="Calibrate a camera, a table and an arm, on a page.")


@calibrate.callback(invoke_without_command=True)
def open_calibration(
    context: typer.Context,
    out: Annotated[Path, typer.Option(help="File that is written.")] = Path("rig.json"),
    camera: Annotated[
        str, typer.Option(help="v4l2:NUMBER, stream:PORT or a video.")
    ] = "v4l2:0",
    robot: Annotated[str, typer.Option(help="Address of the arm's controller.")] = "",
    table: Annotated[str, typer.Option(help="Preset of the table.")] = "full_size",
    tags: Annotated[
        Path | None,
        typer.Option(help="CSV of measured tags: number,x,y (m, table frame)."),
    ] = None,
    hand: Annotated[
        bool, typer.Option("--hand", help="A camera over a hand's field, without arm.")
    ] = False,
    field: Annotated[
        str, typer.Option(help="Of --hand: length x width of the field, m.")
    ] = "0.5x0.6",
    lab: Annotated[
        bool, typer.Option("--lab", help="The virtual lab's camera and arm.")
    ] = False,
    host: cli_play.Host = "127.0.0.1",
    port: cli_play.Port = 8490,
    browser: cli_play.Browser = True,
) -> None:
    """Calibrate, step by step: lens, table, puck, paddle, arm; one file in the end.

    --hand calibrates the camera of a hand (teleop --by shadow): lens, field, paddle.
    """
    if context.invoked_subcommand is not None:
        return
    require("starlette", "play")
    require("uvicorn", "play")
    from marl_airhockey.hardware.calibration.server import application

    if hand:
        path = Path("hand.json") if out == Path("rig.json") else out
        with _hand_session(camera, _size(field), path, tags, lab) as of_hand:
            cli_play.host_table(
                lambda access: application(of_hand, access.refusal),
                *("calibration", host, port, browser),
            )
        return
    require("rtde_receive", "hardware")
    from marl_airhockey.hardware.calibration.session import CalibrationSession

    if table not in TABLES:
        raise ValueError(f"--table {table!r}: there are {', '.join(TABLES)}")
    if not lab and not robot:
        raise ValueError("--robot: the address of the arm's controller, or take --lab")
    with _devices(lab, camera, robot) as (source, address, operator, client):
        rig = {"table": table, "camera": source, "robot": address, "tool": TOOL}
        rig["operator"] = operator
        measured = _read_tags(tags) if tags else None
        with Camera(open_source(source)) as opened:
            pose = _pose_reader(address)
            session = CalibrationSession(opened, pose, rig, out, measured)
            if client is not None:
                from marl_airhockey.hardware.calibration.helper import Helper

                session.orders.update(Helper(client).orders)
            cli_play.host_table(
                lambda access: application(session, access.refusal),
                *("calibration", host, port, browser),
            )


@contextmanager
def _hand_session(
    camera: str, size: tuple[float, float], out: Path, tags: Path | None, lab: bool
) -> Iterator[HandSession]:
    """Give the session of a hand's camera; in a lab, with its hand."""
    from marl_airhockey.hardware.calibration.hand_session import HandSession

    measured = _read_tags(tags) if tags else None
    with ExitStack() as stack:
        orders: dict[str, Callable[..., None]] = {}
        if lab:
            from marl_airhockey.hardware.calibration.helper import HandHelper
            from marl_airhockey.hardware.calibration.lab_rig import running_lab

            helper = HandHelper(stack.enter_context(running_lab()))
            camera, orders = helper.source, helper.orders
        opened = stack.enter_context(Camera(open_source(camera)))
        session = HandSession(opened, camera, size, out, measured)
        session.orders.update(orders)
        yield session


def _size(text: str) -> tuple[float, float]:
    """Return length and width of a text LENGTHxWIDTH.

    Raises:
        ValueError: another text.
    """
    try:
        length, width = (float(part) for part in text.split("x"))
    except ValueError:
        length = width = 0.0
    if not min(length, width) > 0.0:
        raise ValueError(f"--field {text!r}: expected LENGTHxWIDTH in m, as 0.5x0.6")
    return length, width


@calibrate.command()
def sheets(
    folder: Annotated[Path, typer.Argument(help="Where they are written.")] = Path(),
) -> None:
    """Write the tags and the ChArUco board as PDF files for A4 paper."""
    from marl_airhockey.hardware.calibration.sheets import write_sheets

    for path in write_sheets(folder):
        console.print(f"wrote {path}")


@contextmanager
def _devices(
    lab: bool, camera: str, robot: str
) -> Iterator[tuple[str, str, str, LabClient | None]]:
    """Give camera, robot and operator as a rig names them, and a lab's client."""
    if not lab:
        yield camera, robot, "person", None
        return
    require("rtde_receive", "hardware")
    from marl_airhockey.hardware.calibration.lab_rig import running_lab

    with (
        waiting("opening the lab (longer when it is the first time)"),
        running_lab() as client,
    ):
        info = client.ask("info")
        address = str(info["host"])
        yield f"stream:{info['camera']}", address, f"lab:{client.port}", client


def _pose_reader(address: str) -> Callable[[], Array]:
    """Return a function that reads the pose of an arm's tool."""
    from marl_airhockey.hardware.robot.ur5e import PoseReader

    return PoseReader(address).pose


def _read_tags(path: Path) -> dict[int, Array]:
    """Read the measured places of tags.

    Raises:
        ValueError: a file that cannot be read, or a line that is none, named.
    """
    found: dict[int, Array] = {}
    try:
        lines = path.read_text().split()
    except OSError as error:
        raise ValueError(f"--tags {path}: {error.strerror}") from error
    for line in lines:
        try:
            number, x, y = line.split(",")
            found[int(number)] = tag_corners(np.array([float(x), float(y)]))
        except ValueError:
            raise ValueError(f"--tags {path}: {line!r} is no number,x,y") from None
    return found
