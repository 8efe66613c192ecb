"""Code of the kernels of a scenario, which is stored in the folder of compiled code."""

from __future__ import annotations

import gzip
import hashlib
import json
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

from marl_airhockey.code_export import ExportedGame, translated
from marl_airhockey.device.kernel import KernelText
from marl_airhockey.device.module import kernel_module
from marl_airhockey.sim.jit.folders import code_folder
from marl_airhockey.sim.jit.targets import GPU, machine_of
from marl_airhockey.sim.world.keywords import Keywords


class DeviceCode(NamedTuple):
    """Arrays and kernels of a scenario."""

    game: ExportedGame
    code: bytes
    """PTX of a GPU, or LLVM bitcode of this machine."""


def device_code(
    scenario: str, keywords: Keywords, starts: int, target: str
) -> DeviceCode:
    """Return the code of a scenario: from the folder of compiled code, or compiled.

    Args:
        scenario: Name of a scenario.
        keywords: Keywords of the worlds.
        starts: Number of starts of episodes.
        target: `targets.GPU`, or `module.HOST`.

    Raises:
        ValueError: The control step is not compiled.
    """
    asked = repr((_sources(), scenario, sorted(keywords.items()), starts, target))
    digest = hashlib.sha256(asked.encode()).hexdigest()[:24]
    path = code_folder() / f"device-{digest}.json.gz"
    if path.exists():
        facts, image, code = json.loads(gzip.decompress(path.read_bytes()))
        game = ExportedGame(facts, bytes.fromhex(image))
        return DeviceCode(game, bytes.fromhex(code))
    texts, games = translated([scenario], keywords, starts)
    game = games[scenario]
    module = kernel_module(KernelText(game.facts, game.image), texts, target)
    code = module.as_bitcode()
    if target == GPU:
        code = machine_of(GPU).emit_assembly(module).encode()
    stored = json.dumps([game.facts, game.image.hex(), code.hex()])
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_suffix(".part")
    draft.write_bytes(gzip.compress(stored.encode()))
    draft.replace(path)
    return DeviceCode(game, code)


@cache
def _sources() -> str:
    """Return a hash of everything that the code depends on."""
    digest = hashlib.sha256()
    for name in ("llvmlite", "numba", "numpy"):
        digest.update(version(name).encode())
    for path in sorted(Path(__file__).parents[1].rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()
