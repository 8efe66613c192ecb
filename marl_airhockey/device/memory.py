"""Memory of worlds on a torch device, and the starts of their episodes."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from marl_airhockey.code_export import ExportedGame
from marl_airhockey.device.code import device_code
from marl_airhockey.device.kernel import KernelText
from marl_airhockey.device.launch import CudaLauncher, HostLauncher, Launcher
from marl_airhockey.device.module import HOST
from marl_airhockey.device.world_text import HEADER, NUMBER
from marl_airhockey.sim.jit.targets import GPU
from marl_airhockey.sim.world.keywords import Keywords
from marl_airhockey.types import Array

FAILURES = {1: "an action is not finite", 2: "a function needs more memory"}
"""Reasons why the step of a world failed, by its status."""


class WorldMemory:
    """Arrays of B worlds of a scenario on a torch device, and its kernels.

    A row of ``rows`` is a world, as `world_text` describes it.

    Args:
        scenario: Name of a scenario.
        num_worlds: Number of worlds, B.
        device: Torch device; of a GPU, with its index.
        starts: Number of different starts.
        keywords: Keywords of the worlds.

    Raises:
        ValueError: The control step is not compiled.
        RuntimeError: A package is missing.
    """

    def __init__(
        self,
        scenario: str,
        num_worlds: int,
        device: torch.device,
        starts: int,
        keywords: Keywords,
    ) -> None:
        target = GPU if device.type == "cuda" else HOST
        game, code = device_code(scenario, keywords, starts, target)
        self.facts, self.starts = game.facts, starts
        self._text = text = KernelText(*game)
        self._launcher: Launcher = (
            CudaLauncher(code, device.index) if target == GPU else HostLauncher(code)
        )
        size = num_worlds * text.stride
        flat = torch.zeros(size, dtype=torch.uint8, device=device)
        self.rows = flat.view(num_worlds, text.stride)
        """Memory of the worlds (B, bytes)."""
        self.now = 0
        """The moment that is the current one, 0 or 1."""
        self.pools = self._prepared(game, device)
        """Images of all starts (rows, size), for both moments as the current one."""

    def _prepared(self, game: ExportedGame, device: torch.device) -> list[Tensor]:
        images = start_images(game, self._text.size)
        both = [images, swapped(game, images)]
        pools = [torch.from_numpy(rows).to(device) for rows in both]
        scratch = torch.empty(len(images) * self._text.arena, dtype=torch.uint8)
        scratch = scratch.to(device)
        for odd, pool in enumerate(pools):
            arguments = pool, pool, scratch, self.starts, odd
            self.launch("begin", self.starts, *arguments)
        return pools

    def launch(self, kernel: str, worlds: int, *arguments: Tensor | int) -> None:
        """Call a kernel for a number of worlds, with the addresses of tensors."""
        values = [a.data_ptr() if isinstance(a, Tensor) else a for a in arguments]
        self._launcher.launch(kernel, worlds, *values)

    def array(self, name: str) -> Tensor:
        """Return an array of all worlds (B, ...), a view of the memory."""
        entry = self.facts["arrays"][name]
        kind = getattr(torch, entry["dtype"])
        start = HEADER + entry["offset"]
        size = int(np.prod(entry["shape"])) * kind.itemsize
        flat = self.rows[:, start : start + size].view(kind)
        found: Tensor = flat.reshape(len(self.rows), *entry["shape"][1:])
        return found

    def begin(self, seed: int) -> None:
        """Begin the first episode in all worlds; world i has the start seed + i."""
        self.now, worlds = 0, len(self.rows)
        numbers = torch.arange(seed, seed + worlds, device=self.rows.device)
        self._numbers.copy_(numbers)
        self._start(numbers, slice(None))

    def restart(self, chosen: Tensor) -> None:
        """Begin a new episode in some worlds, by index (W,)."""
        numbers = self._numbers[chosen] + (len(self.rows) | 1)
        self._numbers[chosen] = numbers
        self._start(numbers, chosen)

    @property
    def _numbers(self) -> Tensor:
        """Numbers of the starts of the worlds (B,), a view."""
        return self.rows[:, NUMBER : NUMBER + 8].view(torch.int64)[:, 0]

    def _start(self, numbers: Tensor, worlds: Tensor | slice) -> None:
        """Copy the images of some starts (W,) to worlds, a part at a time."""
        image = self.rows[:, HEADER : HEADER + self._text.size]
        chosen = torch.arange(len(image), device=image.device)[worlds]
        pool = self.pools[self.now]
        parts = (torch.split(x, self.starts) for x in (chosen, numbers))
        for part, which in zip(*parts, strict=True):
            image[part] = pool[which % self.starts]
            self.rows[part, :NUMBER] = 0

    def check(self) -> None:
        """Check that no step failed; it waits for the device.

        Raises:
            ValueError: The step of a world failed. The message gives the reason.
        """
        status = self.rows[:, :4].view(torch.int32)[:, 0]
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
