"""Page without a server: a folder with the page, games as code, and policies.

Any web server can serve the folder. The match runs in the browser, in the code that
`code_export` writes.
"""

from __future__ import annotations

import base64
import gzip
import json
import shutil
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from marl_airhockey.code_export import ExportedGame, exported
from marl_airhockey.play.ladder import Level, usual_level
from marl_airhockey.play.live_match import COUNTDOWN, RATE, RESUME, RETRY, LiveMatch
from marl_airhockey.play.open_table import GOAL_STOP
from marl_airhockey.play.server import PALETTE, WEB
from marl_airhockey.policies.load import ZOO
from marl_airhockey.sim.world.keywords import Keywords

STARTS = 50
"""Number of different starts of each game."""
CLOCK = {
    **{"rate": RATE, "countdown": COUNTDOWN, "resume": RESUME},
    **{"retry": RETRY, "goal_stop": GOAL_STOP},
}
"""Ticks per second, and the times of a match, s."""
PREFIX = "zoo/"


def write_static_page(out: Path, scenarios: Sequence[str]) -> list[Path]:
    """Write a folder that plays without a server, and return its files.

    Args:
        out: Folder, which is created. Files of an older page are replaced.
        scenarios: Names of the games, the first one opens the page.

    Raises:
        ValueError: The code of a game cannot be exported, an opponent is no policy of
            the zoo, or the folder contains other files.
        ModuleNotFoundError: The linker for WebAssembly is not installed.
    """
    mark = out / "games" / "index.json"
    if out.exists() and any(out.iterdir()) and not mark.exists():
        raise ValueError(f"{out}: the folder contains other files; give another one")
    keywords = Keywords(control_dt=LiveMatch.CONTROL_DT)
    code, games = exported(scenarios, "wasm32", keywords, STARTS)
    for name in ("games", "policies", "web"):
        shutil.rmtree(out / name, ignore_errors=True)
    shutil.copytree(WEB, out / "web", ignore=shutil.ignore_patterns("page.html"))
    shutil.copy(WEB / "page.html", out / "index.html")
    (out / "palette.css").write_text(PALETTE)
    (out / "mode").write_text(json.dumps({"mode": "static"}))
    (out / "games").mkdir()
    (out / "policies").mkdir()
    _pack(out / "games" / "code.bin", code)
    rows = []
    for name, game in games.items():
        content = _game(name, keywords, game)
        _pack(out / "games" / f"{name}.bin", json.dumps(content).encode())
        for level in content["ladder"]:
            file = f"{level['driver'].removeprefix(PREFIX)}.npz"
            shutil.copy(ZOO / file, out / "policies" / file)
        match = content["match"]
        row = {"name": name, "title": match["title"], "seats": len(match["seats"])}
        rows.append(row)
    mark.write_text(json.dumps({"clock": CLOCK, "games": rows}))
    return sorted(path for path in out.rglob("*") if path.is_file())


def _game(name: str, keywords: Keywords, game: ExportedGame) -> dict[str, Any]:
    """Return all data of a game, for `static/table.js`."""
    match = LiveMatch(name, {}, keywords)
    try:
        ladder = match.drivers.ladder
        return {
            "match": match.describe(),
            "ladder": [_row(level) for level in ladder],
            "usual": usual_level(ladder).name,
            "policy": match.drivers.best_policy,
            "facts": game.facts,
            "image": base64.b64encode(game.image).decode(),
        }
    finally:
        match.close()


def _row(level: Level) -> dict[str, Any]:
    if not level.driver.startswith(PREFIX):
        raise ValueError(f"{level.driver}: only policies of the zoo run in the browser")
    return asdict(level)


def _pack(path: Path, data: bytes) -> None:
    """Write a compressed file, always with the same bytes."""
    path.write_bytes(gzip.compress(data, mtime=0))
