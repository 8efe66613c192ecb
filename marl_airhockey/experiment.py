"""Evaluation, leagues and training from Python, as the commands of these names do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from marl_airhockey.contracts.driver import Driver
from marl_airhockey.contracts.scenario import Scenario
from marl_airhockey.evaluation.as_trained import as_trained, seen_in
from marl_airhockey.evaluation.evaluate import TEST_SEED, EvaluationResult
from marl_airhockey.evaluation.evaluate import evaluate as evaluate_driver
from marl_airhockey.evaluation.league import LEAGUE_SEED, play_league
from marl_airhockey.evaluation.standings import Standings
from marl_airhockey.policies.load import load_policy
from marl_airhockey.registry import find_scenario, make_agent
from marl_airhockey.world.build import Keywords

if TYPE_CHECKING:
    from marl_airhockey.learn.run import ProgressCallback


def evaluate(
    player: object,
    scenario: str | Scenario | None = None,
    *,
    episodes: int = 200,
    seed: int = TEST_SEED,
    **keywords: Unpack[Keywords],
) -> EvaluationResult:
    """Let a player play episodes at ``paddle_0`` and measure it.

    What is not given, a policy's run or file says: scenario, options, profile,
    observations, control_dt. The result names them.

    Args:
        player: of any kind, see `registry.make_agent`.
        scenario: of any kind, see `registry.find_scenario`; None for that of training.
        episodes: number of episodes, played all at once.
        seed: seed of the first; training never sees those from 2,000,000 on.
        **keywords: of the environment, players of other seats among them.

    Raises:
        ValueError: a seat without a player, or one that does not fit, named.
    """
    driver = make_agent(player)
    name = _name(player, driver)
    played, keywords = as_trained({name: driver}, scenario, keywords)
    driver = seen_in(driver, keywords)
    return evaluate_driver(driver, name, played, episodes, seed, keywords)


def league(
    scenario: str,
    players: Mapping[str, object] | Sequence[str],
    *,
    games: int = 100,
    seed: int = LEAGUE_SEED,
    **keywords: Unpack[Keywords],
) -> Standings:
    """Let every player play every other and rate them.

    What is not given is as the policies were trained, which must agree.

    Args:
        scenario: a game of two sides or more.
        players: players of any kind by name, see `registry.make_agent`; or names alone.
        games: number of games of each pair; they change ends at half of them.
        seed: seed of the first game.
        **keywords: of the environment.

    Raises:
        ValueError: a single player, or a scenario without sides that play each other.
    """
    if isinstance(players, str):
        raise ValueError(f"players: a list of names is expected, got {players!r}")
    named = players if isinstance(players, Mapping) else {n: n for n in players}
    drivers = {name: make_agent(player) for name, player in named.items()}
    _, keywords = as_trained(drivers, scenario, keywords)
    drivers = {name: seen_in(driver, keywords) for name, driver in drivers.items()}
    return play_league(scenario, drivers, games, seed, keywords)


@dataclass(frozen=True)
class TrainingResult:
    """Result of a training run."""

    folder: Path
    """Folder of the run; a player by itself, its best policy"""
    steps: int
    """Steps of single worlds"""
    metrics: dict[str, float]
    """Last row of ``evaluations.csv``: "success" or "score", "return" and so on"""

    def policy(self, deterministic: bool = True) -> Driver:
        """Return the best policy as a driver."""
        return load_policy(self.folder, deterministic)


def train(
    scenario: str,
    folder: str | Path | None = None,
    *,
    algo: str = "ppo",
    data: Sequence[str | Path] = (),
    report: ProgressCallback | None = None,
    **settings: Any,
) -> TrainingResult:
    """Train a policy with PPO and the preset of a scenario, or by another algorithm.

    Args:
        scenario: a name, or code, see `registry.find_scenario`.
        folder: of the run; None for ``runs/SCENARIO-SEED``.
        algo: "ppo"; "sac_her", for scenarios with goals; "bc" or "iql", which learn
            from recordings.
        data: files of recordings and folders of them, for those.
        report: called with steps done, steps in all and the latest evaluation.
        **settings: changes of the preset, see `learn.ppo_config.PPOConfig`,
            `learn.hindsight.config.HindsightConfig` and
            `learn.offline.config.OfflineConfig`: `total_steps`, `seed`, `profile`,
            `observe`, `options`, `drivers` and so on.

    Raises:
        ValueError: an unknown scenario or setting, or a folder that holds a run.
        RuntimeError: a missing extra, with the line that installs it.
    """
    from marl_airhockey.learn.algorithms import make_config
    from marl_airhockey.learn.train import train as train_config

    config = make_config(algo, scenario, data, settings)
    name = find_scenario(scenario).name
    kind = "" if algo == "ppo" else f"{algo}-"
    place = Path(folder or Path("runs") / f"{name}-{kind}{config.seed}")
    row = train_config(config, place, report)
    return TrainingResult(place, int(row["steps"]), dict(row))


def _name(player: object, driver: Driver) -> str:
    if isinstance(player, (str, Path)):
        return str(player)
    return str(getattr(driver, "source", type(driver).__name__))
