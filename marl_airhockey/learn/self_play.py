"""Self-play: worlds in which the learner plays itself, its snapshots and scripts."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from marl_airhockey.envs.slots import SlotEnv
from marl_airhockey.evaluation.games import teams_of
from marl_airhockey.learn.action_penalty import ActionPenalty
from marl_airhockey.learn.device import torch_device
from marl_airhockey.learn.mirror import Mirror
from marl_airhockey.learn.self_play_config import SelfPlayConfig
from marl_airhockey.learn.snapshot_pool import MEMBER, SnapshotPool
from marl_airhockey.policies.numpy_policy import NumpyPolicy
from marl_airhockey.registry import make_driver
from marl_airhockey.sim.world.roster import Roster
from marl_airhockey.sim.world.step_result import StepResult
from marl_airhockey.types import Array

SCORE_WEIGHT = 0.05
"""Weight of the latest game in the running score against an opponent."""


class SelfPlayEnv(SlotEnv):
    """Slots of the learner: all seats of some worlds, and one team in the other worlds.

    In the other worlds the learner gets a team at every start of an episode. All other
    teams get the same opponent, which is sampled from the scripts and from the pool of
    snapshots. Opponents that the learner loses to are more likely (prioritized
    fictitious self-play; Vinyals et al., 2019). In half of these games the opponent
    moves at a share of its commanded speed.

    Args:
        config: Settings of the run.
        num_worlds: Number of worlds, B.
        folder: Folder of the snapshots.
    """

    def __init__(self, config: SelfPlayConfig, num_worlds: int, folder: Path) -> None:
        scripted = {name: make_driver(name) for name in config.opponents}
        forms = [driver.observe for driver in scripted.values() if driver.observe]
        keywords = config.training_keywords
        super().__init__(config.scenario, num_worlds, forms, **keywords)
        self._config, self._folder = config, folder
        scene = self.world.scene
        self._teams = teams_of([seat.team for seat in scene.seats])
        members = [np.flatnonzero(self._teams == t) for t in np.unique(self._teams)]
        self._members = np.array(members)
        self._mirrored = round(config.self_play_fraction * num_worlds)
        self._rng = np.random.default_rng(config.seed)
        self._pace = np.ones(num_worlds)
        self._roster = Roster(self.world)
        for name, driver in scripted.items():
            self._roster.add(name, driver)
        self._scripts = len(scripted)
        self._pool = SnapshotPool(torch_device(config.device))
        self._scores = np.full(self._scripts, 0.5)
        self._snapshots: list[Path] = []
        self._opponent = np.full(num_worlds, -1)
        """Index in the scores of the opponent in each world; -1 for none."""
        mirrored = np.arange(self._mirrored)
        others = np.arange(self._mirrored, num_worlds)
        seats, teammates = len(scene.seats), self._members.shape[1]
        self._rows = np.concatenate([mirrored.repeat(seats), others.repeat(teammates)])
        self._seats = np.tile(np.arange(seats), len(mirrored))
        self._seats = np.concatenate(
            [self._seats, np.zeros(len(others) * teammates, int)]
        )
        self._learner = np.zeros(num_worlds, np.int64)
        self.num_envs = len(self._rows)
        self._returns = np.zeros(self.num_envs)
        self._lengths = np.zeros(self.num_envs, np.int64)
        for path in sorted(folder.glob("*.npz")):
            self.add_opponent(path)

    @property
    def scores(self) -> dict[str, float]:
        """Running score of the learner against each opponent, by name."""
        past = [path.stem for path in self._snapshots]
        names = [*self._roster.names[: self._scripts], *past]
        return dict(zip(names, self._scores.tolist(), strict=True))

    def snapshot(self, policy: NumpyPolicy, steps: int) -> None:
        """Add the current learner to the pool, see `add_opponent`.

        Args:
            policy: Policy of the learner.
            steps: Number of training steps so far, which is the name of the file.
        """
        self._folder.mkdir(parents=True, exist_ok=True)
        path = self._folder / f"{steps:012d}.npz"
        policy.save(path)
        self.add_opponent(path)

    def add_opponent(self, path: Path) -> None:
        """Add the policy of a file to the pool.

        If the pool is full, it replaces the one that the learner beats most often.
        """
        policy = NumpyPolicy.load(path)
        if len(self._snapshots) < self._config.pool:
            self._pool.put(len(self._snapshots), policy)
            if not self._snapshots:
                self._roster.add("pool", self._pool)
            self._scores = np.append(self._scores, 0.5)
            self._snapshots.append(path)
            return
        weakest = int(self._scores[self._scripts :].argmax())
        opponent = self._scripts + weakest
        self._snapshots[weakest].unlink()
        self._snapshots[weakest] = path
        self._pool.put(weakest, policy)
        self._scores[opponent] = 0.5
        self._begin(np.flatnonzero(self._opponent == opponent))

    def _draw(self, count: int) -> Array:
        """Sample the indices of opponents, (count,)."""
        config = self._config
        weight = (
            np.maximum(1.0 - self._scores, 0.0) ** config.opponent_sampling_exponent
            + 0.02
        )
        groups = slice(0, self._scripts), slice(self._scripts, None)
        scripted = config.scripted_fraction if self._scripts else 0.0
        shares = scripted, 1.0 - scripted
        for group, share in zip(groups, shares, strict=True):
            total = weight[group].sum()
            weight[group] *= share / total if total else 0.0
        return self._rng.choice(len(weight), count, p=weight / weight.sum())

    def _begin(self, worlds: Array) -> None:
        """Sample teams and opponents for the episodes that begin in some worlds."""
        worlds = worlds[worlds >= self._mirrored]
        if not len(worlds) or not len(self._scores):
            return
        seated, drawn = self._roster.seated, self._draw(len(worlds))
        self._opponent[worlds] = drawn
        # All snapshots are one player.
        seated[worlds] = np.minimum(drawn, self._scripts)[:, None]
        low, high = self._config.opponent_speed_range
        pace = self._rng.uniform(low, high, len(worlds))
        full = self._rng.random(len(worlds)) < 0.5
        self._pace[worlds] = np.where(full, 1.0, pace)
        self._learner[worlds] = self._rng.integers(0, len(self._members), len(worlds))
        mine = self._members[self._learner[worlds]]
        seated[worlds[:, None], mine] = -1
        slots = self._mirrored * len(self._teams)
        teammates = self._members.shape[1]
        first = slots + (worlds - self._mirrored) * teammates
        self._seats[first[:, None] + np.arange(teammates)] = mine
        self._roster.begin(worlds)
        if len(self._pool):
            member = np.maximum(self._opponent - self._scripts, 0)
            self._roster.recall(self._scripts, MEMBER, member)

    def _restarted(self, worlds: Array, last: StepResult) -> None:
        """Update the scores against opponents at full speed; sample new opponents."""
        seats = self._members[:, 0]
        counted = (worlds >= self._mirrored) & (self._pace[worlds] == 1.0)
        for world in worlds[counted].tolist():
            won = last.success[world, seats]
            opponent = self._opponent[world]
            score = float(won[self._learner[world]])
            if not won.any():
                score = 1.0 / len(seats)
            self._scores[opponent] += SCORE_WEIGHT * (score - self._scores[opponent])
        self._begin(worlds)

    def _pick(self, rows: Array) -> Array:
        return np.asarray(rows[self._rows, self._seats])

    def _done(self, ended: Array) -> Array:
        return np.asarray(ended[self._rows])

    def world_of(self, slot: int) -> int:
        return int(self._rows[slot])

    def _all_began(self) -> None:
        self._begin(np.arange(self.world.num_worlds))

    def _of_worlds(self, actions: Array) -> Array:
        """Return the actions of all seats, those of the learner and of opponents."""
        every = np.zeros((self.world.num_worlds, len(self._teams), 2))
        self._roster.ask(every)
        every *= self._pace[:, None, None]
        every[self._rows, self._seats] = actions
        return every


def make_training_env(config: SelfPlayConfig, num_worlds: int, pool: Path) -> SlotEnv:
    """Build the worlds of a training, or a part of them.

    Args:
        config: Configuration of the run.
        num_worlds: Number of worlds.
        pool: Folder of the snapshots of self-play.
    """
    if config.self_play:
        env: SlotEnv = SelfPlayEnv(config, num_worlds, pool)
    else:
        env = SlotEnv(config.scenario, num_worlds, **config.training_keywords)
    if config.mirrored_share:
        env.mirror = Mirror(
            env.world.observer.labels, config.mirrored_share, config.seed
        )
    weights = config.action_rate_weight, config.action_jerk_weight, config.cost_weight
    if any(weights):
        env.penalty = ActionPenalty(*weights)
    return env
