"""Length of an episode, also in the specification of gymnasium."""

from __future__ import annotations

from gymnasium.envs.registration import EnvSpec

from marl_airhockey.sim.world.world import World


class EpisodeLength:
    """Mixin with the length of an episode, which can be set at any time."""

    world: World

    @property
    def max_cycles(self) -> int:
        """Length of an episode in control steps."""
        return self.world.max_cycles

    @max_cycles.setter
    def max_cycles(self, cycles: int) -> None:
        self.world.max_cycles = cycles


class SpecifiedLength(EpisodeLength):
    """Mixin whose ``spec`` always contains the current length of an episode."""

    _spec: EnvSpec | None = None

    @property
    def spec(self) -> EnvSpec | None:
        """Specification that ``gymnasium.make`` set, or None."""
        if self._spec is not None:
            self._spec.max_episode_steps = self.world.max_cycles
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = spec
