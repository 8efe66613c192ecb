"""Worlds on a GPU, with torch tensors."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from marl_airhockey.build import build_world
from marl_airhockey.code_export import ExportedGame
from marl_airhockey.device.code import device_code
from marl_airhockey.device.kernel import HEADER, KernelText
from marl_airhockey.device.launch import CudaLauncher, HostLauncher, Launcher
from marl_airhockey.device.module import HOST
from marl_airhockey.sim.contracts.scenario import Scenario
from marl_airhockey.sim.core.checks import check_count
from marl_airhockey.sim.jit.targets import GPU
from marl_airhockey.sim.world.keywords import Keywords, check_keywords
from marl_airhockey.types import Array

STARTS = 1024
"""Default number of starts of episodes."""
FAILURES = {1: "an action is not finite", 2: "a function needs more memory"}
"""Reasons why the step of a world failed, by its status."""


class DeviceStep(NamedTuple):
    """Result of a control step of B worlds with S seats, for all seats."""

    observation: Tensor
    """(B, S, D) float32; of the new episode in worlds in which one ended."""
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

    All seats are open and observe the true state, with the reaction time of the game.
    Starts are sampled on the CPU. Episode n of world i has the start, the physics and
    the random streams of the seed (i + n B) modulo the number of starts.

    The tensors of a result are overwritten by the next step.

    Args:
        scenario: Name of a scenario.
        num_worlds: Number of worlds, B.
        device: Torch device, such as "cuda". On "cpu", the same code runs on one core,
            for tests.
        starts: Number of different starts.
        keywords: Keywords as of `make.make_world`.

    Raises:
        ValueError: A keyword is not supported on a device. The message names it.
        RuntimeError: There is no such device, or a package is missing.
    """

    def __init__(
        self,
        scenario: str | Scenario,
        num_worlds: int,
        device: str = "cuda",
        starts: int = STARTS,
        keywords: Keywords | None = None,
    ) -> None:
        keywords = keywords or Keywords()
        check_keywords(keywords)
        if not isinstance(scenario, str):
            raise ValueError(
                f"scenario: {scenario!r}: worlds on a device need the name of a "
                "scenario, and its options as options={...}"
            )
        _check_supported(scenario, keywords)
        self.num_worlds = check_count("num_worlds", num_worlds)
        self.device = torch.device(device)
        if self.device.type == "cuda" and not torch.cuda.is_available():
            raise RuntimeError(f"device: {device!r}: torch finds no GPU here")
        check_count("starts", starts)
        target = GPU if self.device.type == "cuda" else HOST
        self._game, code = device_code(scenario, keywords, starts, target)
        self._starts, self._text = starts, KernelText(*self._game)
        self._launcher: Launcher = (
            CudaLauncher(code, self.device.index or 0)
            if target == GPU
            else HostLauncher(code)
        )
        self._build()

    def _build(self) -> None:
        """Allocate the memory of the worlds, and prepare the starts."""
        text, b, device = self._text, self.num_worlds, self.device
        images = start_images(self._game, text.size)
        both = [images, swapped(self._game, images)]
        self._pools = [torch.from_numpy(rows).to(device) for rows in both]
        scratch = torch.empty(len(images) * text.arena, dtype=torch.uint8)
        scratch = scratch.to(device)
        for odd, pool in enumerate(self._pools):
            arguments = pool, pool, scratch
            self._launch("begin", self._starts, *arguments, self._starts, odd)
        self._memory = torch.zeros(b * text.stride, dtype=torch.uint8, device=device)
        facts = self._game.facts
        _, seats, width = facts["arrays"]["observe.observation"]["shape"]
        made: dict[str, Any] = {"device": device}
        self._observation = torch.zeros((b, seats, width), **made)
        self._final = torch.zeros((b, seats, width), **made)
        self._reward = torch.zeros((b, seats), dtype=torch.float64, **made)
        self._ended = torch.zeros((2, b), dtype=torch.bool, **made)
        self._actions = torch.zeros((b, seats, 2), dtype=torch.float64, **made)
        self._success = torch.zeros((b, seats), dtype=torch.bool, **made)
        self._now = 0

    @property
    def seats(self) -> int:
        """Number of seats, S."""
        return self._actions.shape[1]

    def _launch(self, kernel: str, worlds: int, *arguments: Tensor | int) -> None:
        values = [a.data_ptr() if isinstance(a, Tensor) else a for a in arguments]
        self._launcher.launch(kernel, worlds, *values)

    def _array(self, name: str) -> Tensor:
        """Return an array of all worlds (B, ...), a view of the memory."""
        entry = self._game.facts["arrays"][name]
        kind = getattr(torch, entry["dtype"])
        size = kind.itemsize
        rows = self._memory.view(self.num_worlds, self._text.stride)
        start = HEADER + entry["offset"]
        count = int(np.prod(entry["shape"]))
        flat = rows[:, start : start + count * size].view(kind)
        found: Tensor = flat.reshape(self.num_worlds, *entry["shape"][1:])
        return found

    def current(self, name: str) -> Tensor:
        """Return an array of the current moment (B, ...), such as "state.position"."""
        return self._array(f"moment_{self._now}.{name}")

    def reset(self) -> Tensor:
        """Begin the first episode in all worlds; return the observation (B, S, D)."""
        self._now, b, text = 0, self.num_worlds, self._text
        rows = self._memory.view(b, text.stride)
        pool = self._pools[0].view(self._starts, text.size)
        rows[:, :HEADER] = 0
        for first in range(0, b, self._starts):
            count = min(self._starts, b - first)
            part = rows[first : first + count, HEADER : HEADER + text.size]
            part.copy_(pool[:count])
        self._observation.copy_(self._array("observe.observation"))
        return self._observation

    def step(self, actions: Tensor) -> DeviceStep:
        """Move all worlds by a control step; begin a new episode where one ended.

        Args:
            actions: Target velocities (B, S, 2), divided by the top speed, ego frames.
        """
        self._actions.copy_(actions)
        after = 1 - self._now
        self._launch(
            *("step", self.num_worlds, self._memory, self._pools[0]),
            *(self._pools[after], self.num_worlds, self._starts, self._now),
            *(self._actions, self._observation, self._final, self._reward, self._ended),
            self._success,
        )
        self._now = after
        terminated, truncated = self._ended
        return DeviceStep(
            *(self._observation, self._reward, terminated, truncated),
            *(self._success, self._final),
        )

    def check(self) -> None:
        """Check that no step failed; it waits for the device.

        Raises:
            ValueError: The step of a world failed. The message gives the reason.
        """
        rows = self._memory.view(self.num_worlds, self._text.stride)
        status = rows[:, :4].view(torch.int32)[:, 0]
        for number, reason in FAILURES.items():
            if bool((status == number).any()):
                world = int((status == number).nonzero()[0, 0])
                raise ValueError(f"world {world}: {reason}")


def start_images(game: ExportedGame, size: int) -> Array:
    """Return the images of all starts (rows, size), with space for their past."""
    words, values = game.facts["starts"]["words"], game.facts["starts"]["values"]
    rows = np.zeros((len(values), size), np.uint8)
    rows[:, : len(game.image)] = np.frombuffer(game.image, np.uint8)
    longs = rows.view(np.uint64)
    for row, text in enumerate(values):
        longs[row, words] = np.frombuffer(bytes.fromhex(text), np.uint64)
    return rows


def swapped(game: ExportedGame, images: Array) -> Array:
    """Return images in which moment 1 is the current one."""
    other, arrays = images.copy(), game.facts["arrays"]
    for name, entry in arrays.items():
        twin = name.replace("moment_0.", "moment_1.", 1)
        if name.startswith("moment_0.") and twin in arrays:
            size = int(np.prod(entry["shape"])) * np.dtype(entry["dtype"]).itemsize
            starts = entry["offset"], arrays[twin]["offset"]
            a, b = (slice(start, start + size) for start in starts)
            other[:, a], other[:, b] = images[:, b], images[:, a]
    return other


def _check_supported(scenario: str, keywords: Keywords) -> None:
    """Raise ValueError for what worlds on a device cannot do."""
    reasons = {
        "backend": keywords.get("backend", "numba") != "numba",
        "drivers": bool(keywords.get("drivers")),
        "profile": keywords.get("profile", "ideal") != "ideal",
        "observe": keywords.get("observe", "velocity") != "velocity",
        "goals": keywords.get("goals", "flat") != "flat",
    }
    for name, unsupported in reasons.items():
        if unsupported:
            raise ValueError(
                f"{name}: {keywords.get(name)!r} is not supported on a device; omit "
                f"{name}, or use device='cpu' of make_world"
            )
    world = build_world(scenario, 1, True, keywords)
    world.reset(0)
    if world.eliminated is not None:
        raise ValueError(
            f"{scenario!r}: games that eliminate players are not supported on a device"
        )
