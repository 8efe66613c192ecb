"""Commands ``airhockey ur-emulator`` and ``airhockey ur-emulator fault``."""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
from typing import Annotated, Any

import typer

from marl_airhockey.cli.options import console
from marl_airhockey.cli.progress import waiting

ADDRESS = "127.0.0.5"
"""Default address of the emulator."""
Address = Annotated[
    str,
    typer.Option(
        help="Loopback address of the emulated robot, 127.x.x.x. Each robot needs its "
        "own, because the ports are fixed."
    ),
]

ur_emulator = typer.Typer(
    help="Emulate the controller of a UR5e until Ctrl+C, for ur_rtde and other "
    "clients.\n\nThe arm presses a paddle on an empty table. The dashboard, script and "
    "RTDE ports respond like those of PolyScope 5.12. Only the script of ur_rtde is "
    "run, no other URScript."
)


@ur_emulator.callback(invoke_without_command=True)
def open_emulator(
    context: typer.Context,
    address: Address = ADDRESS,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            help="Fault at a set time after the start: NAME@3s, or NAME@3s-5s to "
            "switch it off at 5 s. Can be repeated."
        ),
    ] = None,
    polyscope: Annotated[
        str, typer.Option(help="Version of PolyScope that the emulator reports.")
    ] = "5.12.2",
) -> None:
    """Emulate a UR5e with PolyScope 5.12 until Ctrl+C."""
    if context.invoked_subcommand is not None:
        return
    _check_loopback(address)
    from marl_airhockey.hardware.lab.setup import LabSetup
    from marl_airhockey.hardware.ur_emulator.controller import Controller
    from marl_airhockey.hardware.ur_emulator.emulator import (
        ScheduledFault,
        parse_version,
        serve_emulator,
    )

    version = parse_version(polyscope)
    schedule = [ScheduledFault.parse(text) for text in fault or []]
    with waiting("preparing the arm"):
        controller = Controller(LabSetup().make_arm(), version)

    def announce() -> None:
        """Print the address."""
        console.print(
            f"UR5e at {address}: RTDE 30004, script 30003, dashboard 29999\n"
            f"faults: airhockey ur-emulator fault NAME --address {address}\n"
            "Ctrl+C stops the emulator"
        )

    with contextlib.suppress(KeyboardInterrupt):
        asyncio.run(serve_emulator(controller, address, schedule, announce))


@ur_emulator.command("fault")
def switch_fault(
    name: Annotated[
        str | None,
        typer.Argument(help="Name of a fault; by default all faults are listed."),
    ] = None,
    off: Annotated[
        bool, typer.Option("--off", help="Switch the fault off instead of on.")
    ] = False,
    address: Address = ADDRESS,
) -> None:
    """Switch a fault of the running emulator on or off."""
    from marl_airhockey.hardware.ur_emulator.faults import FAULTS

    if name is None:
        for known, row in FAULTS.items():
            console.print(f"{known:18} {row.what}")
        return
    safety = _ask(address, "fault", name=name, on=not off)["safety"]
    console.print(f"{name}: {'off' if off else FAULTS[name].what}; safety {safety}")


@ur_emulator.command("status")
def show_status(address: Address = ADDRESS) -> None:
    """Print the state of the running emulator.

    The state contains safety mode, running script, pose, force and commands. Commands
    are counted by their number in the script of ur_rtde; 24 is servoL.
    """
    for name, value in _ask(address, "status").items():
        console.print(f"{name:10} {value}")


def _ask(address: str, do: str, **order: Any) -> dict[str, Any]:
    """Return the response of the running emulator at an address.

    Raises:
        RuntimeError: No emulator is running there.
    """
    from marl_airhockey.hardware.lab.door import DoorClient, port_in
    from marl_airhockey.hardware.ur_emulator.emulator import door_file

    port = port_in(door_file(address))
    try:
        client = DoorClient(port, "ur-emulator") if port is not None else None
    except OSError:
        client = None
    if client is None:
        raise RuntimeError(
            f"ur-emulator: no emulator is running at {address}; start one with "
            f"airhockey ur-emulator --address {address}"
        )
    answer = client.ask(do, **order)
    client.close()
    return answer


def _check_loopback(address: str) -> None:
    """Check that an address is an IPv4 loopback address.

    Raises:
        ValueError: It is another address, or not an address.
    """
    try:
        found = ipaddress.ip_address(address)
    except ValueError:
        found = None
    if found is None or not found.is_loopback or found.version != 4:
        raise ValueError(
            f"--address {address!r}: expected a loopback address, 127.x.x.x"
        )
