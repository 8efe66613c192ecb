"""Report of a challenge: the results of a player as JSON, Markdown and a plot."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

PROTOCOL = 5
"""Number of the protocol. It is increased whenever the challenge changes, because cards
of different protocols are not comparable."""

PARTS = ("tasks", "duel", "population", "set pieces")
"""Parts of the protocol."""


@dataclass(frozen=True)
class ChallengeResult:
    """Result of a task in one profile, a duel against one opponent, or a suite."""

    part: str
    """Part of the protocol, one of `PARTS`."""
    name: str
    """Name of the task, of the opponent, or of the suite."""
    profile: str
    player: str
    """File or name of the driver that played; "" if it was not played."""
    score: float
    """Success, or share of won games of a duel, where a draw counts half."""
    low: float
    high: float
    """Ends of the 95 % interval of the score."""
    first_shot: float = 0.0
    """Share of episodes of a task that succeeded before a second distinct touch."""
    deployability: str = ""
    """Class A to D of a task, see `Deployability`."""
    note: str = ""
    """Reason why it was not played; "" if it was played."""


@dataclass(frozen=True)
class ChallengeReport:
    """Results of a player in all parts of the protocol."""

    name: str
    version: str
    """Version of the library."""
    episodes: int
    """Number of episodes of each task and profile."""
    games: int
    """Number of games against each opponent."""
    files: dict[str, str]
    """SHA-256 of the policy files, by name."""
    results: tuple[ChallengeResult, ...]
    protocol: int = PROTOCOL

    @property
    def profiles(self) -> list[str]:
        """Profiles in which tasks were played."""
        return list(dict.fromkeys(r.profile for r in self._of("tasks")))

    def _of(self, part: str) -> list[ChallengeResult]:
        """Return the results of a part."""
        return [result for result in self.results if result.part == part]

    @staticmethod
    def total(results: Sequence[ChallengeResult]) -> tuple[float, float, float]:
        """Return the mean score of some results, and its 95 % interval.

        The interval combines those of the results as independent errors. Parts that
        were not played count as exactly 0.
        """
        mean = float(np.mean([result.score for result in results]))
        errors = [(r.score - r.low, r.high - r.score) for r in results if r.player]
        down, up = np.sqrt(np.square([(0.0, 0.0), *errors]).sum(0)) / len(results)
        return mean, mean - float(down), mean + float(up)

    @property
    def totals(self) -> dict[str, tuple[float, float, float]]:
        """Mean scores with intervals: the tasks in each profile, and each part."""
        tasks = self._of("tasks")
        found = {
            profile: self.total([r for r in tasks if r.profile == profile])
            for profile in self.profiles
        }
        return found | {part: self.total(self._of(part)) for part in PARTS}

    def to_json(self) -> str:
        """Return the card as JSON."""
        data = asdict(self)
        data["totals"] = self.totals
        return json.dumps(data, indent=1)

    @staticmethod
    def from_json(text: str) -> ChallengeReport:
        """Read a card that `to_json` wrote.

        Raises:
            ValueError: The text is not a card, or it is a card of another protocol.
        """
        try:
            data = json.loads(text)
            data.pop("totals")
            data["results"] = tuple(ChallengeResult(**row) for row in data["results"])
            card = ChallengeReport(**data)
        except (KeyError, TypeError, json.JSONDecodeError) as error:
            raise ValueError(f"not a card of a challenge: {error}") from error
        if card.protocol != PROTOCOL:
            raise ValueError(
                f"card of protocol {card.protocol}, expected {PROTOCOL}: play the "
                "challenge again"
            )
        return card

    def to_markdown(self) -> str:
        """Return the card as Markdown."""
        lines = [
            f"# {self.name}",
            "",
            f"marl_airhockey {self.version}, protocol {self.protocol}: {self.episodes} "
            f"episodes of each task and profile, {self.games} games of each duel.",
            "",
            "| part | score | 95 % |",
            "| --- | --- | --- |",
        ]
        lines += [
            f"| {part} | {mean:.3f} | {low:.3f}..{high:.3f} |"
            for part, (mean, low, high) in self.totals.items()
        ]
        head = "| task | profile | player | success (95 %) | first shot | deployable |"
        lines += ["", head, "| --- " * 6 + "|"]
        lines += [
            f"| {r.name} | {r.profile} | {r.player or r.note} | {_share(r)} | "
            f"{r.first_shot:.3f} | {r.deployability} |"
            for r in self._of("tasks")
        ]
        lines += ["", "| opponent or suite | player | score (95 %) |"]
        lines += ["| --- " * 3 + "|"]
        lines += [
            f"| {r.name} | {r.player or r.note} | {_share(r)} |"
            for part in PARTS[1:]
            for r in self._of(part)
        ]
        return "\n".join(lines) + "\n"

    def save(self, folder: Path) -> list[Path]:
        """Write card.json, card.md and card.png, and return their paths."""
        folder.mkdir(parents=True, exist_ok=True)
        files = [folder / f"card.{kind}" for kind in ("json", "md", "png")]
        files[0].write_text(self.to_json())
        files[1].write_text(self.to_markdown())
        plot_card(self, files[2])
        return files


def _share(result: ChallengeResult) -> str:
    return f"{result.score:.3f} ({result.low:.2f}..{result.high:.2f})"


def plot_card(card: ChallengeReport, path: Path) -> None:
    """Plot the score in each part as points with their 95 % intervals."""
    from marl_airhockey.sim.render.charts import panels, point, save, series

    played = [result for result in card.results if result.player]
    parts = {
        "success": [r for r in played if r.part == "tasks"],
        "score or success": [r for r in played if r.part != "tasks"],
    }
    size = 8.4, 0.36 * max(map(len, _names_of(parts).values())) + 1.6
    figure, (grid,) = panels(1, 2, size)
    for axes, (label, results) in zip(grid, parts.items(), strict=True):
        names = _names_of(parts)[label]
        for result in results:
            task = result.part == "tasks"
            k = card.profiles.index(result.profile) if task else 0
            shift = 0.2 * (k - (len(card.profiles) - 1) / 2) if task else 0.0
            height = names.index(result.name) + shift
            ends = result.low, result.high
            where = f"profile {result.profile}" if task else ""
            point(axes, height, result.score, ends, series(k), where)
        axes.set_yticks(range(len(names)), [name.replace("_", " ") for name in names])
        axes.set(xlim=(-0.03, 1.03), ylim=(max(len(names), 1) - 0.4, -0.6))
        axes.set_xlabel(f"{label} (95 % interval)")
    grid[0].set_title(f"tasks, n = {card.episodes} episodes")
    grid[1].set_title(f"duels, n = {card.games}, and suites")
    save(figure, path, card.name)


def _names_of(parts: dict[str, list[ChallengeResult]]) -> dict[str, list[str]]:
    """Return the names of the tasks, and of the opponents and suites."""
    return {
        label: list(dict.fromkeys(r.name for r in results))
        for label, results in parts.items()
    }
