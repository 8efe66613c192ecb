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
    """Kind of file to begin with."""

    SCENARIO = "scenario"
    DRIVER = "driver"


def new(
    kind: Annotated[TemplateKind, typer.Argument(help="What to write.")],
    name: Annotated[str, typer.Argument(help="Name of it, like my_task.")],
    out: Annotated[
        Path, typer.Option(file_okay=False, help="Folder of the file.")
    ] = Path(),
) -> None:
    """Write a scenario or a driver to change: a commented example that runs."""
    if not name.isidentifier() or name != name.lower():
        raise ValueError(f"{name!r}: expected a name like my_task")
    if keyword.iskeyword(name) or find_spec(name) is not None:
        raise ValueError(f"{name}: Python has such a word or module; take another")
    own = scenario_names() if kind is TemplateKind.SCENARIO else driver_names()
    if name in {*own, *plugin_names(f"{kind}s")}:
        raise ValueError(f"{name}: there is a {kind} of this name; take another")
    if not out.is_dir():
        raise ValueError(f"{out}: there is no such folder")
    camel = "".join(word.capitalize() for word in name.split("_"))
    text = (TEMPLATES / f"{kind}.py").read_text()
    path = out / f"{name}.py"
    try:
        with path.open("x") as file:
            file.write(text.replace("Template", camel).replace("my_driver", name))
    except FileExistsError:
        raise ValueError(f"{path}: there is such a file; take another name") from None
    console.print(f"wrote {path}; next:")
    if kind is TemplateKind.SCENARIO:
        console.print(f"  airhockey list {path}")
        console.print(f"  airhockey evaluate random --scenario {path}")
        console.print(f"  airhockey train {path}")
    else:
        console.print(f"  airhockey evaluate {path} --scenario touch")
