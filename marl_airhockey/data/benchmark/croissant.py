"""Card of a dataset, JSON-LD in the Croissant format 1.0 of MLCommons."""

from __future__ import annotations

import hashlib
import json
from importlib import metadata
from pathlib import Path
from typing import Any

from marl_airhockey.data.benchmark.catalogue import NamedDataset
from marl_airhockey.data.benchmark.content import references
from marl_airhockey.data.parquet import KEYS
from marl_airhockey.data.reader import read_head
from marl_airhockey.sim.core.recording import EPISODES, META, STEPS

CARD = "croissant.json"
"""Name of the file of a card."""
CONTEXT = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "sc": "https://schema.org/",
    "cr": "http://mlcommons.org/croissant/",
    "dct": "http://purl.org/dc/terms/",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "citeAs": "cr:citeAs",
    "column": "cr:column",
    "conformsTo": "dct:conformsTo",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "equivalentProperty": "cr:equivalentProperty",
    "examples": {"@id": "cr:examples", "@type": "@json"},
    "extract": "cr:extract",
    "field": "cr:field",
    "fileObject": "cr:fileObject",
    "fileProperty": "cr:fileProperty",
    "fileSet": "cr:fileSet",
    "format": "cr:format",
    "includes": "cr:includes",
    "isLiveDataset": "cr:isLiveDataset",
    "jsonPath": "cr:jsonPath",
    "key": "cr:key",
    "md5": "cr:md5",
    "parentField": "cr:parentField",
    "path": "cr:path",
    "recordSet": "cr:recordSet",
    "references": "cr:references",
    "regex": "cr:regex",
    "repeated": "cr:repeated",
    "replace": "cr:replace",
    "samplingRate": "cr:samplingRate",
    "separator": "cr:separator",
    "source": "cr:source",
    "subField": "cr:subField",
    "transform": "cr:transform",
}
"""Terms of the format."""
TYPES = {"b": "sc:Boolean", "i": "sc:Integer", "u": "sc:Integer", "f": "sc:Float"}
"""Types of the format, by the kind of the NumPy type."""
PARQUET = "application/x-parquet"
PUBLISHED_ON = "2026-11-25"
"""Date of this version of the datasets."""


def write_card(dataset: NamedDataset, folder: Path) -> Path:
    """Write the card of a dataset into its folder; return its path."""
    heads = {
        path.parent.name: read_head(path.parent) for path in folder.glob(f"*/{META}")
    }
    files = sorted(folder.glob(f"*/{STEPS}/*.parquet"))
    episodes = sorted(folder.glob(f"*/{EPISODES}"))
    card = {
        "@context": CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "name": dataset.name.replace("/", "-"),
        "alternateName": dataset.name,
        "description": _description(dataset),
        "datePublished": PUBLISHED_ON,
        "citeAs": f"marl_airhockey, dataset {dataset.name}",
        "license": "https://spdx.org/licenses/MIT.html",
        "creator": {"@type": "sc:Organization", "name": "marl_airhockey"},
        "isBasedOn": f"marl_airhockey=={metadata.version('marl_airhockey')}",
        "keywords": ["air hockey", "reinforcement learning", "offline RL", "robotics"],
        "version": f"{dataset.name.rpartition('-v')[2]}.0.0",
        "distribution": [_file(folder, path) for path in (*episodes, *files)],
        "recordSet": [
            _record_set(folder, path, heads[path.parents[1].name]) for path in files
        ],
    }
    path = folder / CARD
    path.write_text(json.dumps(card, indent=1) + "\n")
    return path


def _description(dataset: NamedDataset) -> str:
    known = references().get(dataset.scenario)
    scale = (
        ""
        if known is None
        else f"Mean return: random actions {known[0]}, expert {known[1]}. "
    )
    players = ", ".join(
        " against ".join([part.player, *part.others.values()]) for part in dataset.parts
    )
    return (
        f"Air hockey, {dataset.scenario}, {dataset.tier}: {dataset.what}. Simulated. "
        f"Drivers: {players}. {scale}A row is a control step; step 0 of an episode is "
        "the state before its first step."
    )


def _file(folder: Path, path: Path) -> dict[str, Any]:
    name = path.relative_to(folder).as_posix()
    return {
        "@type": "cr:FileObject",
        "@id": name,
        "name": name,
        "contentUrl": name,
        "encodingFormat": PARQUET,
        "contentSize": f"{path.stat().st_size} B",
        "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
    }


def _record_set(folder: Path, path: Path, head: dict[str, Any]) -> dict[str, Any]:
    """Return the description of the steps in a file, for a card."""
    file = path.relative_to(folder).as_posix()
    own = f"steps/{file}"
    columns = {
        **{name: {"dtype": "int32", "shape": []} for name in KEYS},
        **head["columns"],
    }
    return {
        "@type": "cr:RecordSet",
        "@id": own,
        "name": own,
        "description": "Control steps",
        "field": [
            {
                "@type": "cr:Field",
                "@id": f"{own}/{name}",
                "name": name,
                "description": _column(column),
                "dataType": TYPES[_kind(column["dtype"])],
                "repeated": bool(column["shape"]),
                "source": {
                    "fileObject": {"@id": file},
                    "extract": {"column": name},
                },
            }
            for name, column in columns.items()
        ],
    }


def _kind(dtype: str) -> str:
    return "b" if dtype == "bool" else dtype[0]


def _column(column: dict[str, Any]) -> str:
    """Return the description of a column with its shape, unit and frame."""
    parts = [f"shape {tuple(column['shape'])}"]
    parts += [f"{key} {column[key]}" for key in ("unit", "frame") if column.get(key)]
    return ", ".join(parts)
