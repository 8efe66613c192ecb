"""Worlds on a GPU, with torch tensors."""

from __future__ import annotations

import secrets
from collections.abc import Iterable
from typing import NamedTuple

import torch
from torch import Tensor

from marl_airhockey.build import build_world, seat_drivers
from marl_airhockey.code_export import check_exported
from marl_airhockey.device.critic import DeviceCriticState
from marl_airhockey.device.memory import WorldMemory
from marl_airhockey.device.networks import DeviceNetwork, network_of
from marl_airhockey.sim.contracts.scenario import Scenario
from marl_airhockey.sim.core.checks import check_count
from marl_airhockey.sim.world.keywords import Keywords, check_keywords
from marl_airhockey.sim.world.world import World

STARTS = 1024
"""Default number of starts of episodes."""


class DeviceStep(NamedTuple):
    """Result of a control step of B worlds with S open seats."""

    observation: Tensor
    """(B, S, D) float32; of the new episode in worlds that began one."""
    reward: Tensor
    """(B, S) float64."""
    terminated: Tensor
    """(B,) bool."""
    truncated: Tensor
    """(B,) bool."""
    success: Tensor
    """(B, S) bool; success of the episode so far, also of one that ended."""
    final_observation: Tensor
    """Last observation (B, S, D) of the episodes that ended; arbitrary elsewhere."""


class DeviceWorld:
    """B worlds of a scenario on a torch device, with the bits of a CPU.

    Seats without a driver are open. They observe the true state, with the reaction time
    of the game. Starts are sampled on the CPU, when the worlds are created. Episode n
    of world i has the start, the physics and the random streams of the seed
    s + i + n D, modulo the number of starts. Here s is the seed of `reset`, and D is B,
    or B + 1 if B is even.

    The tensors of a result are overwritten by the next step or reset.

    Args:
        scenario: Name of a scenario.
        num_worlds: Number of worlds, B.
        device: Torch device, such as "cuda". On "cpu", the same code runs on one core.
        starts: Number of different starts.
        keywords: Keywords as of `make.make_world`. Drivers are policies.
        autoreset: True to begin a new episode in the step in which one ended. False if
            `reset_worlds` begins it.

    Raises:
        ValueError: A keyword is not supported on a device. The message names it.
        RuntimeError: There is no such device, or a package is missing.
    """

    def __init__(
        self,
        scenario: str | Scenario,
        num_worlds: int,
        device: torch.device | str = "cuda",
        starts: int = STARTS,
        keywords: Keywords | None = None,
        autoreset: bool = True,
    ) -> None:
        keywords = keywords or Keywords()
        check_keywords(keywords)
        if not isinstance(scenario, str):
            raise ValueError(
                f"scenario: {scenario!r}: worlds on a device need the name of a "
                "scenario, and its options as options={...}"
            )
        _check_supported(keywords)
        self.num_worlds = check_count("num_worlds", num_worlds)
        check_count("starts", starts)
        self._autoreset = autoreset
        self._seed: int | None = 0
        undriven = keywords.copy()
        undriven.pop("drivers", None)
        self.single = build_world(scenario, 1, autoreset, undriven)
        """A world on the CPU, with the scene, the spaces and the labels."""
        _check_world(self.single)
        width = len(self.single.observation_labels)
        networks = {
            seat: network_of(f"paddle_{seat}", driver, width)
            for seat, driver in seat_drivers(self.single.scenario, keywords).items()
        }
        self.device = _device_of(device)
        self._networks = {
            seat: DeviceNetwork(network, self.device)
            for seat, network in networks.items()
        }
        seats = range(len(self.single.scene.seats))
        self.open = [seat for seat in seats if seat not in networks]
        """Indices of the open seats."""
        self._memory = WorldMemory(scenario, num_worlds, self.device, starts, undriven)
        self._build()

    def _build(self) -> None:
        """Allocate the tensors of the results, for all seats."""
        seats, width = self.single.scene.seats, len(self.single.observation_labels)
        rows = self.num_worlds, len(seats)

        def made(*shape: int, dtype: torch.dtype = torch.float32) -> Tensor:
            return torch.zeros(shape, dtype=dtype, device=self.device)

        self._observation, self._final = made(*rows, width), made(*rows, width)
        self._reward = made(*rows, dtype=torch.float64)
        self._ended = made(2, self.num_worlds, dtype=torch.bool)
        self._actions = made(*rows, 2, dtype=torch.float64)
        self._success = made(*rows, dtype=torch.bool)
        self._critic = DeviceCriticState(self.single, self._memory)
        chosen = torch.tensor(self.open, dtype=torch.int64, device=self.device)
        self._chosen = chosen if self._networks else None

    @property
    def seats(self) -> int:
        """Number of open seats, S."""
        return len(self.open)

    def current(self, name: str) -> Tensor:
        """Return an array of the current moment (B, ...), such as "state.position"."""
        return self._memory.array(f"moment_{self._memory.now}.{name}")

    def observation(self) -> Tensor:
        """Return the current observation of the open seats (B, S, D)."""
        (seen,) = self._of_open([self._observation])
        return seen

    def critic_state(self) -> Tensor:
        """Return the true state for a critic of all seats (B, n), float32, a new one.

        `global_state.GlobalState` defines the elements.
        """
        return self._critic.read()

    def seed(self, seed: int | None = None) -> None:
        """Set the number that the next `reset` adds to the numbers of all starts.

        Args:
            seed: Number, 0 or more; None for one from the operating system.
        """
        if seed is not None and seed < 0:
            raise ValueError(f"seed: {seed}; expected 0 or more")
        self._seed = secrets.randbelow(2**31) if seed is None else seed

    def reset(self, seed: int | None = None) -> Tensor:
        """Begin an episode in all worlds; return the observation (B, S, D).

        Args:
            seed: Number as of `seed`. Without one, each world begins its next episode,
                or its first one after `seed` or after its creation.
        """
        if seed is not None:
            self.seed(seed)
        if self._seed is None:
            self._memory.restart(torch.arange(self.num_worlds, device=self.device))
        else:
            self._memory.begin(self._seed)
        self._seed = None
        self._observation.copy_(self._memory.array("observe.observation"))
        return self.observation()

    def reset_worlds(self, worlds: Tensor) -> None:
        """Begin a new episode in some worlds, by index (W,)."""
        self._memory.restart(worlds)
        seen = self._memory.array("observe.observation")
        self._observation[worlds] = seen[worlds]

    def step(self, actions: Tensor) -> DeviceStep:
        """Move all worlds by a control step.

        Args:
            actions: Target velocities (B, S, 2), divided by the top speed, ego frames.

        Raises:
            ValueError: The shape is wrong.
        """
        memory, shape = self._memory, (self.num_worlds, self.seats, 2)
        if actions.shape != shape:
            raise ValueError(
                f"actions: expected shape {shape}, got {tuple(actions.shape)}"
            )
        if self._chosen is None:
            self._actions.copy_(actions)
        else:
            self._actions[:, self._chosen] = actions.to(self._actions.dtype)
        for seat, network in self._networks.items():
            self._actions[:, seat] = network(self._observation[:, seat]).double()
        after = 1 - memory.now
        memory.launch(
            *("step", self.num_worlds, memory.rows, memory.pools[0]),
            *(memory.pools[after], self.num_worlds, memory.starts, memory.now),
            *(int(self._autoreset), self._actions, self._observation, self._final),
            *(self._reward, self._ended, self._success),
        )
        memory.now = after
        terminated, truncated = self._ended
        arrays = self._observation, self._reward, self._success, self._final
        seen, reward, success, final = self._of_open(arrays)
        return DeviceStep(seen, reward, terminated, truncated, success, final)

    def _of_open(self, arrays: Iterable[Tensor]) -> list[Tensor]:
        """Return the rows of the open seats of arrays (B, seats, ...)."""
        if self._chosen is None:
            return list(arrays)
        return [array.index_select(1, self._chosen) for array in arrays]

    def check(self) -> None:
        """Check that no step failed; it waits for the device.

        Raises:
            ValueError: The step of a world failed. The message gives the reason.
        """
        self._memory.check()

    def close(self) -> None:
        """Close the world on the CPU."""
        self.single.close()


def _check_supported(keywords: Keywords) -> None:
    """Raise ValueError for what worlds on a device cannot do."""
    reasons = {
        "backend": keywords.get("backend", "numba") != "numba",
        "profile": keywords.get("profile", "ideal") != "ideal",
        "observe": keywords.get("observe", "velocity") != "velocity",
        "goals": keywords.get("goals", "flat") != "flat",
    }
    for name, unsupported in reasons.items():
        if unsupported:
            raise ValueError(
                f"{name}: {keywords.get(name)!r} is not supported on a device; omit "
                f"{name}, or use device='cpu'"
            )


def _check_world(world: World) -> None:
    """Raise ValueError for what a world computes outside of its control step."""
    check_exported(world)
    if world.physics.any_of("action_delay"):
        raise ValueError(
            "physics: action_delay is not supported on a device; leave it out"
        )


def _device_of(name: torch.device | str) -> torch.device:
    """Return a torch device; that of a GPU has an index.

    Raises:
        RuntimeError: There is no GPU.
    """
    device = torch.device(name)
    if device.type != "cuda":
        return device
    if not torch.cuda.is_available():
        raise RuntimeError(f"device: {str(name)!r}: torch finds no GPU here")
    here = torch.cuda.current_device() if device.index is None else device.index
    return torch.device("cuda", here)
