"""Commands ``airhockey calibrate`` and ``airhockey calibrate sheets``."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from marl_airhockey.cli import hosting
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
"""Pose of the paddle's foot, flange frame, m and rad."""

calibrate = typer.Typer(
    help="Calibrate a camera, a table and an arm, on a page in the browser.\n\n"
    "The steps are lens, table, puck, paddle and arm. The last step writes one rig "
    "file. --hand calibrates the camera of a hand for teleop --by shadow. Its steps "
    "are lens, field and paddle."
)


@calibrate.callback(invoke_without_command=True)
def open_calibration(
    context: typer.Context,
    out: Annotated[
        Path,
        typer.Option(help="Rig file to write; with --hand by default hand.json."),
    ] = Path("rig.json"),
    camera: Annotated[
        str,
        typer.Option(help="Camera: v4l2:NUMBER, stream:PORT or the path of a video."),
    ] = "v4l2:0",
    robot: Annotated[
        str,
        typer.Option(
            help="Network address of the arm's controller; required without --lab and "
            "--hand."
        ),
    ] = "",
    table: Annotated[
        str,
        typer.Option(
            help="Preset of the table: standard, full_size, ubc_pro or ubc_wood."
        ),
    ] = "full_size",
    tags: Annotated[
        Path | None,
        typer.Option(
            help="CSV file with the measured centres of the tags: number,x,y (m, table "
            "frame)."
        ),
    ] = None,
    hand: Annotated[
        bool,
        typer.Option(
            "--hand", help="Calibrate the camera over a hand's field, without an arm."
        ),
    ] = False,
    field: Annotated[
        str,
        typer.Option(help="Size of the hand's field for --hand, LENGTHxWIDTH, m."),
    ] = "0.5x0.6",
    lab: Annotated[
        bool,
        typer.Option("--lab", help="Use the camera and the arm of the virtual lab."),
    ] = False,
    host: hosting.Host = "127.0.0.1",
    port: hosting.Port = 8490,
    browser: hosting.Browser = True,
) -> None:
    """Calibrate a camera, a table and an arm, on a page in the browser."""
    if context.invoked_subcommand is not None:
        return
    require("starlette", "play")
    require("uvicorn", "play")
    from marl_airhockey.hardware.calibration.server import application

    if hand:
        path = Path("hand.json") if out == Path("rig.json") else out
        with _hand_session(camera, _size(field), path, tags, lab) as of_hand:
            hosting.host_table(
                lambda access: application(of_hand, access.refusal),
                *("calibration", host, port, browser),
            )
        return
    require("rtde_receive", "hardware")
    from marl_airhockey.hardware.calibration.session import CalibrationSession

    if table not in TABLES:
        raise ValueError(f"--table {table!r}: expected one of {', '.join(TABLES)}")
    if not lab and not robot:
        raise ValueError(
            "no arm was given; add --robot with the address of its controller, or --lab"
        )
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
            hosting.host_table(
                lambda access: application(session, access.refusal),
                *("calibration", host, port, browser),
            )


@contextmanager
def _hand_session(
    camera: str, size: tuple[float, float], out: Path, tags: Path | None, lab: bool
) -> Iterator[HandSession]:
    """Yield the calibration session of a hand's camera, with the hand of a lab."""
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
    """Return length and width, m, of a text LENGTHxWIDTH.

    Raises:
        ValueError: The text has another form.
    """
    try:
        length, width = (float(part) for part in text.split("x"))
    except ValueError:
        length = width = 0.0
    if not min(length, width) > 0.0:
        raise ValueError(
            f"--field {text!r}: expected LENGTHxWIDTH in m, for example 0.5x0.6"
        )
    return length, width


@calibrate.command()
def sheets(
    folder: Annotated[
        Path, typer.Argument(help="Folder in which the files are written.")
    ] = Path(),
) -> None:
    """Write the tags and the ChArUco board as PDF files for A4 paper."""
    from marl_airhockey.hardware.calibration.sheets import write_sheets

    for path in write_sheets(folder):
        console.print(f"wrote {path}")


@contextmanager
def _devices(
    lab: bool, camera: str, robot: str
) -> Iterator[tuple[str, str, str, LabClient | None]]:
    """Yield camera, robot and operator as in a rig file, and the client of a lab."""
    if not lab:
        yield camera, robot, "person", None
        return
    require("rtde_receive", "hardware")
    from marl_airhockey.hardware.calibration.lab_rig import running_lab

    with (
        waiting("opening the lab (the first time takes longer)"),
        running_lab() as client,
    ):
        info = client.ask("info")
        address = str(info["host"])
        yield f"stream:{info['camera']}", address, f"lab:{client.port}", client


def _pose_reader(address: str) -> Callable[[], Array]:
    """Return a function that returns the pose of the arm's tool."""
    from marl_airhockey.hardware.robot.ur5e import PoseReader

    return PoseReader(address).pose


def _read_tags(path: Path) -> dict[int, Array]:
    """Return the corners (4, 2) of the measured tags, table frame, m, by number.

    Raises:
        ValueError: The file cannot be read, or a line has another form.
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
            raise ValueError(
                f"--tags {path}: line {line!r}; expected number,x,y"
            ) from None
    return found
