"""Length of an episode, as gymnasium's specifications of environments hold it."""

from __future__ import annotations

from gymnasium.envs.registration import EnvSpec

from marl_airhockey.world.world import World


class SpecifiedLength:
    """Mixin whose ``spec`` always holds the length of an episode."""

    world: World
    _spec: EnvSpec | None = None

    @property
    def spec(self) -> EnvSpec | None:
        """Specification by which ``gymnasium.make`` built it, or None."""
        if self._spec is not None:
            self._spec.max_episode_steps = self.world.max_cycles
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = spec
