"""TorchRL EnvBase of B worlds with a group of agents for each team."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from tensordict import TensorDict, TensorDictBase
from torchrl.data import Bounded, Categorical, Composite, Unbounded
from torchrl.envs import EnvBase

from marl_airhockey.device.world import DeviceWorld
from marl_airhockey.sim.world.spaces import observation_space
from marl_airhockey.sim.world.world import World


class AirHockeyTorchEnv(EnvBase):  # type: ignore[misc]
    """TorchRL EnvBase of B worlds, with batch size (B,), also for BenchMARL.

    The open seats of team k are the group ``team_k`` of n agents. Tensors of a group
    are float32:

    - Observation ``(team_k, "observation")`` (B, n, D): SI units, ego frames.
    - Action ``(team_k, "action")`` (B, n, 2): target velocities, divided by the top
      speed, -1 to 1, ego frames.
    - Reward ``(team_k, "reward")`` (B, n, 1): sum of the reward terms.

    Each world has these tensors:

    - ``state`` (B, S): true state for a central critic, see `global_state.GlobalState`.
    - ``terminated`` (B, 1): the episode ended by the rules of the scenario.
    - ``truncated`` (B, 1): the number of steps reached the limit of the episode.
    - ``done`` (B, 1): the episode was terminated or truncated.

    Worlds that ended are reset by the key ``_reset``, which collectors and rollouts
    set.

    Args:
        world: Worlds without autoreset, on the CPU or on a device. The tensors of
            worlds on a device stay there.

    Raises:
        ValueError: Observations are images or dictionaries.
    """

    batch_locked = True

    def __init__(self, world: World | DeviceWorld) -> None:
        if isinstance(world, DeviceWorld):
            known, device = world.single, world.device
        else:
            known, device = world, torch.device("cpu")
        super().__init__(device=device, batch_size=[world.num_worlds])
        self.world, self._known = world, known
        seats = self._known.scene.seats
        teams = np.array([seats[i].team for i in world.open])
        rows = {f"team_{k}": np.flatnonzero(teams == k) for k in np.unique(teams)}
        self.group_map = {
            group: [f"paddle_{world.open[i]}" for i in mine]
            for group, mine in rows.items()
        }
        """Names of the agents of each group."""
        # Indices on the CPU would be copied in every step.
        self._rows = {
            group: torch.from_numpy(mine).to(device) for group, mine in rows.items()
        }
        self._make_specs()

    def _make_specs(self) -> None:
        own = observation_space(self._known.observer)
        if not isinstance(own, spaces.Box) or len(own.shape) != 1:
            raise ValueError(
                f"observations: TorchRL needs flat numbers, got {own}; "
                'choose another observe= and goals="flat"'
            )
        batch, device = tuple(self.batch_size), self.device
        whole = self._known.critic_state_space
        low, high = torch.as_tensor(whole.low), torch.as_tensor(whole.high)
        observation: dict[str, Any] = {
            "state": Bounded(
                low.expand(*batch, -1), high.expand(*batch, -1), device=device
            )
        }
        action, reward = {}, {}
        for group, mine in self._rows.items():
            shape = (*batch, len(mine))
            low, high = torch.as_tensor(own.low), torch.as_tensor(own.high)
            seen = Bounded(
                low.expand(*shape, -1), high.expand(*shape, -1), device=device
            )
            moved = Bounded(-1.0, 1.0, (*shape, 2), device)
            paid = Unbounded((*shape, 1), device)
            observation[group] = Composite({"observation": seen}, shape=shape)
            action[group] = Composite({"action": moved}, shape=shape)
            reward[group] = Composite({"reward": paid}, shape=shape)
        flag = Categorical(2, (*batch, 1), device, torch.bool)
        flags = {name: flag.clone() for name in ("done", "terminated", "truncated")}
        self.observation_spec = Composite(observation, shape=batch)
        self.action_spec = Composite(action, shape=batch)
        self.reward_spec = Composite(reward, shape=batch)
        self.done_spec = Composite(flags, shape=batch)

    @property
    def observation_labels(self) -> tuple[str, ...]:
        """Name of each element of an agent's observation."""
        return self._known.observation_labels

    @property
    def state_labels(self) -> tuple[str, ...]:
        """Name of each element of ``state``."""
        return self._known.critic_state_labels

    def _set_seed(self, seed: int | None) -> None:
        self.world.seed(seed)

    def _reset(
        self, tensordict: TensorDictBase | None = None, **_: Any
    ) -> TensorDictBase:
        some = None if tensordict is None else tensordict.get("_reset", None)
        if some is None or bool(some.all()):
            observation = self.world.reset()
        else:
            self.world.reset_worlds(self._given(some.flatten().nonzero()[:, 0]))
            observation = self.world.observation()
        going = torch.zeros(self.batch_size, dtype=torch.bool, device=self.device)
        return self._tensors(observation, going, going)

    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        worlds, seats = self.world.num_worlds, len(self.world.open)
        actions = torch.empty(
            (worlds, seats, 2), dtype=torch.float64, device=self.device
        )
        for group, mine in self._rows.items():
            actions[:, mine] = tensordict[group, "action"].double()
        result = self.world.step(self._given(actions))
        after = self._tensors(result.observation, result.terminated, result.truncated)
        reward = self._tensor(result.reward)[..., None]
        for group, mine in self._rows.items():
            after[group, "reward"] = reward[:, mine]
        return after

    def _given(self, tensor: torch.Tensor) -> Any:
        """Return a tensor as the worlds take it."""
        on_device = isinstance(self.world, DeviceWorld)
        return tensor if on_device else tensor.numpy(force=True)

    def _tensors(self, observation: Any, terminated: Any, truncated: Any) -> TensorDict:
        """Return the entries that a reset and a step have in common."""
        batch, seen = self.batch_size, self._tensor(observation)
        ended, out_of_time = (
            torch.asarray(flag, device=self.device, copy=True)[:, None]
            for flag in (terminated, truncated)
        )
        groups = {
            group: TensorDict({"observation": seen[:, mine]}, [*batch, len(mine)])
            for group, mine in self._rows.items()
        }
        whole = {
            "state": self._tensor(self.world.critic_state()),
            "done": ended | out_of_time,
            "terminated": ended,
            "truncated": out_of_time,
        }
        return TensorDict({**groups, **whole}, batch, device=self.device)

    def _tensor(self, array: Any) -> torch.Tensor:
        return torch.as_tensor(array, dtype=torch.float32, device=self.device)

    def close(self, *, raise_if_closed: bool = True) -> None:
        """Close the worlds."""
        super().close(raise_if_closed=raise_if_closed)
        self.world.close()
