"""Report of a challenge: the results of a player as JSON, Markdown and a plot."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np

PROTOCOL = 3
"""Number of the protocol. It is increased whenever the challenge changes, because cards
of different protocols are not comparable."""


@dataclass(frozen=True)
class ChallengeResult:
    """Result of one task in one profile, or of the duel against one opponent."""

    scenario: str
    profile: str
    opponent: str
    """Opponent; "" in a task."""
    player: str
    """File or name of the driver that played; "" if this part was not played."""
    score: float
    """Success of a task, or share of won games of a duel, where a draw counts half."""
    low: float
    high: float
    """Ends of the 95 % interval of the score."""
    first_shot: float
    """Share of episodes that succeeded before a second distinct touch; 0 in duels."""
    deployability: str
    """Class A to D of a task, see `Deployability`; "" in duels."""
    note: str
    """Reason why this part was not played; "" if it was played."""


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
        return list(dict.fromkeys(r.profile for r in self.results if not r.opponent))

    def total(
        self, keep: Callable[[ChallengeResult], bool]
    ) -> tuple[float, float, float]:
        """Return the mean score of some results, and its 95 % interval.

        The interval combines those of the results as independent errors. Parts that
        were not played count as exactly 0.
        """
        kept = [result for result in self.results if keep(result)]
        mean = float(np.mean([result.score for result in kept]))
        errors = [(r.score - r.low, r.high - r.score) for r in kept if r.player]
        down, up = np.sqrt(np.square([(0.0, 0.0), *errors]).sum(0)) / len(kept)
        return mean, mean - float(down), mean + float(up)

    @property
    def totals(self) -> dict[str, tuple[float, float, float]]:
        """Mean scores with intervals: each profile, all tasks, and the duels.

        Duels against the population are apart from those against known opponents.
        """
        found = {}
        for profile in self.profiles:
            in_it = partial(_is_task, profile=profile)
            found[profile] = self.total(in_it)
        found["tasks"] = self.total(lambda r: not r.opponent)
        for part, inside in (("duel", False), ("population", True)):
            those = partial(_is_duel, population=inside)
            found[part] = self.total(those)
        return found

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
            f"| {r.scenario} | {r.profile} | {r.player or r.note} | {_share(r)} | "
            f"{r.first_shot:.3f} | {r.deployability} |"
            for r in self.results
            if not r.opponent
        ]
        lines += ["", "| duel against | player | score (95 %) |", "| --- " * 3 + "|"]
        lines += [
            f"| {r.opponent} | {r.player or r.note} | {_share(r)} |"
            for r in self.results
            if r.opponent
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


def _is_task(result: ChallengeResult, profile: str) -> bool:
    return not result.opponent and result.profile == profile


def _is_duel(result: ChallengeResult, population: bool) -> bool:
    member = result.opponent.startswith("population/")
    return bool(result.opponent) and member == population


def _share(result: ChallengeResult) -> str:
    return f"{result.score:.3f} ({result.low:.2f}..{result.high:.2f})"


def plot_card(card: ChallengeReport, path: Path) -> None:
    """Plot the score in each part as points with their 95 % intervals."""
    from marl_airhockey.sim.render.charts import panels, point, save, series

    played = [result for result in card.results if result.player]
    parts = {
        "success": [result for result in played if not result.opponent],
        "score: win + draw / 2": [result for result in played if result.opponent],
    }
    size = 8.4, 0.36 * max(map(len, _names_of(parts).values())) + 1.6
    figure, (grid,) = panels(1, 2, size)
    for axes, (label, results) in zip(grid, parts.items(), strict=True):
        names = _names_of(parts)[label]
        for result in results:
            k = 0 if result.opponent else card.profiles.index(result.profile)
            shift = 0 if result.opponent else 0.2 * (k - (len(card.profiles) - 1) / 2)
            height = names.index(result.opponent or result.scenario) + shift
            ends = result.low, result.high
            where = "" if result.opponent else f"profile {result.profile}"
            point(axes, height, result.score, ends, series(k), where)
        axes.set_yticks(range(len(names)), [name.replace("_", " ") for name in names])
        axes.set(xlim=(-0.03, 1.03), ylim=(max(len(names), 1) - 0.4, -0.6))
        axes.set_xlabel(f"{label} (95 % interval)")
    grid[0].set_title(f"tasks, n = {card.episodes} episodes")
    grid[1].set_title(f"duels, n = {card.games} games")
    save(figure, path, card.name)


def _names_of(parts: dict[str, list[ChallengeResult]]) -> dict[str, list[str]]:
    """Return the names of the tasks and of the opponents."""
    return {
        label: list(dict.fromkeys(r.opponent or r.scenario for r in results))
        for label, results in parts.items()
    }
