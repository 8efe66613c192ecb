"""Command ``airhockey export-code``."""

from __future__ import annotations

import gzip
import json
from pathlib import Path
from typing import Annotated

import typer

from marl_airhockey.code_export import export_code as write_code
from marl_airhockey.sim.jit.targets import TARGETS
from marl_airhockey.sim.world.keywords import Keywords


def export_code(
    scenario: Annotated[str, typer.Argument(help="Name of a scenario.")],
    target: Annotated[
        str, typer.Option(help=f"Machine that runs the code: {', '.join(TARGETS)}.")
    ] = "wasm32",
    out: Annotated[
        Path, typer.Option(file_okay=False, help="Folder for the code.")
    ] = Path("code"),
    profile: Annotated[
        str, typer.Option(help="Profile of actuation and physics, as for play.")
    ] = "ideal",
) -> None:
    """Write the control step of a scenario as code for browsers or other processors.

    The code is the limits, physics, rules and observations of one world. A JSON file
    says where each array is. WebAssembly needs the extra export.
    """
    path = write_code(scenario, target, out, Keywords(profile=profile))
    code = out / json.loads(path.read_text())["code"]
    data = code.read_bytes()
    size, packed = len(data) / 1000, len(gzip.compress(data)) / 1000
    print(f"{code}: {size:.0f} kB, {packed:.0f} kB compressed; {path} lists its arrays")
