"""Command ``airhockey new``."""

from __future__ import annotations

import keyword
from enum import StrEnum
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from marl_airhockey.cli.options import console
from marl_airhockey.registry import driver_names, plugin_names, scenario_names

TEMPLATES = Path(__file__).parent / "templates"


class TemplateKind(StrEnum):
    """Kind of file to write."""

    SCENARIO = "scenario"
    DRIVER = "driver"


def new(
    kind: Annotated[TemplateKind, typer.Argument(help="Kind of the example.")],
    name: Annotated[
        str, typer.Argument(help="Name of the new scenario or driver, e.g. my_task.")
    ],
    out: Annotated[
        Path, typer.Option(file_okay=False, help="Folder of the new file.")
    ] = Path(),
) -> None:
    """Write a commented example of a scenario or a driver, which runs as it is."""
    if not name.isidentifier() or name != name.lower():
        raise ValueError(
            f"{name!r}: expected lower-case letters, digits and _, for example my_task"
        )
    if keyword.iskeyword(name) or find_spec(name) is not None:
        raise ValueError(
            f"{name}: this is a keyword or a module of Python; choose another name"
        )
    own = scenario_names() if kind is TemplateKind.SCENARIO else driver_names()
    if name in {*own, *plugin_names(f"{kind}s")}:
        raise ValueError(f"{name}: a {kind} has this name; choose another name")
    if not out.is_dir():
        raise ValueError(f"{out}: this folder does not exist")
    camel = "".join(word.capitalize() for word in name.split("_"))
    text = (TEMPLATES / f"{kind}.py").read_text()
    path = out / f"{name}.py"
    try:
        with path.open("x") as file:
            file.write(text.replace("Template", camel).replace("my_driver", name))
    except FileExistsError:
        raise ValueError(f"{path}: this file exists; choose another name") from None
    console.print(f"wrote {path}; next:")
    if kind is TemplateKind.SCENARIO:
        console.print(f"  airhockey list {path}")
        console.print(f"  airhockey evaluate random --scenario {path}")
        console.print(f"  airhockey train {path}")
    else:
        console.print(f"  airhockey evaluate {path} --scenario touch")
