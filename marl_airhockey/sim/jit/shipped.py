"""Compiled code that comes with the package, and a check that it fits this machine.

``airhockey precompile --target x86-64-v3`` compiles for a level of processors instead
of the processor of this machine. A wheel that contains the result starts without
compiling. The code fits if the system and the versions of Python, numba and llvmlite
are the same, and the processor has the features of the level. Each function is found by
its fingerprint, so code of other sources is never loaded.
"""

from __future__ import annotations

import json
import os
from functools import cache
from pathlib import Path
from typing import NamedTuple

from llvmlite import binding

from marl_airhockey.sim.jit.folders import versions

FOLDER = Path(__file__).parents[2] / "precompiled"
"""Folder of the package with the code; absent in a checkout."""
MANIFEST = "manifest.json"
"""File in this folder that names versions, target and features."""
VARIABLE = "MARL_AIRHOCKEY_PRECOMPILED"
"""Environment variable that is 0 to ignore the code that comes with the package."""
LEVELS: dict[str, tuple[str, ...]] = {
    "generic": (),
    # https://gitlab.com/x86-psABIs/x86-64-ABI, table 3.1
    "x86-64-v2": ("cx16", "popcnt", "sse3", "ssse3", "sse4.1", "sse4.2"),
    "x86-64-v3": (
        *("cx16", "popcnt", "sse3", "ssse3", "sse4.1", "sse4.2"),
        *("avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe"),
    ),
}
"""Features of the levels of processors for which code can be compiled. "generic" is the
lowest level of each family, including aarch64."""

Target = tuple[str, str, str]
"""System, processor and additional features, as numba names them."""


class Shipped(NamedTuple):
    """Compiled code that comes with the package."""

    folder: Path | None
    """Folder of the code; None if there is no code that fits."""
    target: Target
    reason: str
    """Reason why the code does not fit; empty if it fits or if there is none."""


@cache
def shipped() -> Shipped:
    """Return the compiled code of the package, if it fits this machine."""
    nothing: Target = ("", "", "")
    path = FOLDER / MANIFEST
    if os.environ.get(VARIABLE) == "0" or not path.exists():
        return Shipped(None, nothing, "")
    try:
        manifest = json.loads(path.read_text())
        reason = _mismatch(manifest)
        system, processor, features = manifest["target"]
    except (OSError, ValueError, KeyError):
        return Shipped(None, nothing, f"has a damaged {MANIFEST}")
    if reason:
        return Shipped(None, nothing, reason)
    return Shipped(FOLDER, (system, processor, features), "")


def write_manifest(folder: Path, level: str) -> None:
    """Write the manifest of compiled code: versions, target and features.

    Args:
        folder: Folder of compiled code.
        level: Name of a level of processors, see `LEVELS`.
    """
    manifest = {
        "versions": versions(),
        "target": [binding.get_process_triple(), level, ""],
        "features": LEVELS[level],
    }
    (folder / MANIFEST).write_text(json.dumps(manifest, indent=1) + "\n")


def _mismatch(manifest: dict[str, dict[str, str]]) -> str:
    """Return how this machine differs from a manifest; "" if it does not differ."""
    for name, here in versions().items():
        if manifest["versions"][name] != here:
            return f"is for {name} {manifest['versions'][name]}, not {here}"
    system, level, _ = manifest["target"]
    here = binding.get_process_triple()
    if system != here:
        return f"is for {system}, not {here}"
    known = binding.get_host_cpu_features()
    missing = [name for name in manifest["features"] if not known.get(name)]
    if missing:
        return f"is for {level}, and this processor has no {', '.join(missing)}"
    return ""
