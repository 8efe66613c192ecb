"""Compare worlds on a GPU with those of the CPU, and measure their speed.

    python scripts/bench/gpu.py --out gpu.json

The same code runs on both (`marl_airhockey.device`). All observations, rewards and ends
of 64 worlds over 2,000 steps of random actions are compared to the bit. The speed is
that of random actions, with 4,096, 65,536 and 1,048,576 worlds, as far as the memory of
the GPU suffices. The code of several scenarios is compiled in parallel.
"""

from __future__ import annotations

import json
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Annotated, Any

import torch
import typer

from marl_airhockey.device.code import device_code
from marl_airhockey.device.module import HOST
from marl_airhockey.device.world import DeviceWorld
from marl_airhockey.sim.jit.targets import GPU
from marl_airhockey.sim.world.keywords import Keywords

WORLDS, STEPS, STARTS = 64, 2000, 256
SIZES = (1 << 12, 1 << 16, 1 << 20)
SECONDS = 2.0
"""Time of a measurement, s."""


def compile_both(scenario: str) -> str:
    """Compile a scenario for the GPU and for the CPU; return its name."""
    for target in (GPU, HOST):
        device_code(scenario, Keywords(), STARTS, target)
    return scenario


def parity(scenario: str, device: str) -> int:
    """Return the number of steps after which the worlds differ; `STEPS` if never."""
    worlds = [DeviceWorld(scenario, WORLDS, name, STARTS) for name in (device, "cpu")]
    seen = [world.reset() for world in worlds]
    random = torch.Generator().manual_seed(0)
    for step in range(STEPS):
        actions = 2.0 * torch.rand((*seen[0].shape[:2], 2), generator=random) - 1.0
        results = [world.step(actions.to(world.device)) for world in worlds]
        ended = results[1].terminated | results[1].truncated
        for name, one, other in zip(results[0]._fields, *results, strict=True):
            rows = ended if name == "final_observation" else slice(None)
            if not torch.equal(one.cpu()[rows], other[rows]):
                return step
    for world in worlds:
        world.check()
    return STEPS


def speed(scenario: str, worlds: int, device: str) -> float:
    """Return the steps per second of all worlds."""
    world = DeviceWorld(scenario, worlds, device, STARTS)
    shape = (*world.reset().shape[:2], 2)
    actions = 2.0 * torch.rand(shape, device=device, dtype=torch.float64) - 1.0
    for _ in range(10):
        world.step(actions)
    torch.cuda.synchronize()
    began, count = time.perf_counter(), 0
    while time.perf_counter() - began < SECONDS:
        for _ in range(20):
            world.step(actions)
        torch.cuda.synchronize()
        count += 20
    return worlds * count / (time.perf_counter() - began)


def main(
    out: Annotated[Path, typer.Option(help="JSON file of the results.")],
    scenarios: Annotated[
        str, typer.Option(help="Scenarios, separated by commas.")
    ] = "juggle,duel,hit_goal,doubles",
    device: Annotated[str, typer.Option(help="Torch device.")] = "cuda",
    jobs: Annotated[int, typer.Option(help="Number of compiling processes.")] = 8,
) -> None:
    """Compare and measure the scenarios."""
    names = scenarios.split(",")
    with ProcessPoolExecutor(jobs) as pool:
        for done in pool.map(compile_both, names):
            print("compiled", done, flush=True)
    found: dict[str, Any] = {"device": torch.cuda.get_device_name(device)}
    for name in names:
        row: dict[str, Any] = {"equal_steps": parity(name, device), "steps": STEPS}
        if name in ("juggle", "duel"):
            for worlds in SIZES:
                try:
                    row[str(worlds)] = round(speed(name, worlds, device))
                except torch.OutOfMemoryError:
                    row[str(worlds)] = None
                torch.cuda.empty_cache()
        found[name] = row
        print(name, row, flush=True)
        out.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    typer.run(main)
