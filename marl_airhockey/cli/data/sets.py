"""Commands ``airhockey data`` for the named datasets."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.box import SIMPLE
from rich.table import Table

from marl_airhockey.cli.options import AsJson, console
from marl_airhockey.cli.progress import bar
from marl_airhockey.sim.core.errors import require


def get(
    name: Annotated[
        str,
        typer.Argument(
            help="Name of the dataset, for example airhockey/juggle/expert-v0."
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            help="New folder for the dataset; by default in the library's cache."
        ),
    ] = None,
) -> None:
    """Build a named dataset on this machine and compare it with the published one."""
    require("pyarrow", "data")
    from marl_airhockey.data.benchmark.build import build_dataset, get_dataset
    from marl_airhockey.data.benchmark.catalogue import find_dataset
    from marl_airhockey.data.benchmark.content import content_of, published

    dataset = find_dataset(name)
    with bar() as shown:
        task = shown.add_task(name, total=1.0, note="")

        def count(done: float) -> None:
            shown.update(task, completed=done)

        if out is None:
            folder = get_dataset(name, count)
        else:
            folder = build_dataset(dataset, out, progress=count)
    found, known = content_of(folder), published()[name]
    console.print(
        f"{folder}: {found.steps} steps, {found.episodes} episodes, "
        f"{found.megabytes:.0f} MB, success {found.success:.3f}, "
        f"return {found.returns:.2f}",
        soft_wrap=True,
    )
    if found.checksum == known.checksum:
        console.print("content: identical to the published one", soft_wrap=True)
    else:
        console.print(
            f"content: checksum {found.checksum[:12]}, published "
            f"{known.checksum[:12]} (success {known.success:.3f}, return "
            f"{known.returns:.2f}); rounding differs between versions and between "
            "processors",
            soft_wrap=True,
        )


def list_datasets(as_json: AsJson = False) -> None:
    """List the named datasets, and which of them are built on this machine."""
    from marl_airhockey.data.benchmark.catalogue import datasets
    from marl_airhockey.data.benchmark.content import published
    from marl_airhockey.data.files import dataset_folder

    contents = published()
    here = {name: dataset_folder(name).exists() for name in datasets()}
    if as_json:
        rows = [
            {"name": name, "built": here[name], **contents[name]._asdict()}
            for name in here
        ]
        console.print_json(json.dumps(rows))
        return
    table = Table(box=SIMPLE, pad_edge=False)
    table.add_column("dataset", no_wrap=True)
    for title in ("success", "return", "MB", "built"):
        table.add_column(title, justify="right", no_wrap=True)
    for name, built in here.items():
        content = contents[name]
        table.add_row(
            name,
            f"{content.success:.3f}",
            f"{content.returns:.2f}",
            f"{content.megabytes:.0f}",
            "yes" if built else "",
        )
    console.print(table)
