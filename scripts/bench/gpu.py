"""Compare worlds on a GPU with those of the CPU, and measure their speed.

    python scripts/bench/gpu.py --out gpu.json

The same code runs on both (`marl_airhockey.device`). All observations, rewards and ends
of 64 worlds over 2,000 steps of random actions are compared to the bit. The speed of
juggle and duel is that of random actions, with 4,096, 65,536 and 1,048,576 worlds, as
far as the memory of the GPU suffices. It is also measured on the CPU, with the threads
of `MARL_AIRHOCKEY_THREADS`. Several scenarios are compiled and compared in parallel.
"""

from __future__ import annotations

import json
import os
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Annotated, Any

import torch
import typer

from marl_airhockey.device.code import device_code
from marl_airhockey.device.module import HOST
from marl_airhockey.device.world import DeviceWorld
from marl_airhockey.evaluation.speed import Case, measure_speed
from marl_airhockey.registry import scenario_names
from marl_airhockey.sim.jit.targets import GPU
from marl_airhockey.sim.world.keywords import Keywords

WORLDS, STEPS, STARTS = 64, 2000, 256
SIZES = (1 << 12, 1 << 16, 1 << 20)
SPEED = ("juggle", "duel")
"""Scenarios whose speed is measured."""
SECONDS = 1.0
"""Time of a measurement, s."""


def compiled(cell: tuple[str, str]) -> tuple[str, str]:
    """Compile a scenario for a target; return both names."""
    scenario, target = cell
    device_code(scenario, Keywords(), STARTS, target)
    return cell


def parity(scenario: str, device: str) -> int:
    """Return the number of steps for which the worlds are equal, at most `STEPS`."""
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
        str, typer.Option(help="Scenarios, separated by commas; empty for all.")
    ] = "",
    device: Annotated[str, typer.Option(help="Torch device.")] = "cuda",
    jobs: Annotated[int, typer.Option(help="Number of compiling processes.")] = 16,
) -> None:
    """Compare and measure the scenarios."""
    cores = os.cpu_count() or 1
    names = scenarios.split(",") if scenarios else scenario_names()
    cells = [(name, target) for name in names for target in (GPU, HOST)]
    found: dict[str, Any] = {"steps": STEPS}
    with ProcessPoolExecutor(jobs) as pool:
        for cell in pool.map(compiled, cells):
            print("compiled", *cell, flush=True)
        equal = pool.map(parity, names, [device] * len(names))
        for name, steps in zip(names, equal, strict=True):
            found[name] = {"equal_steps": steps}
            print(name, "is equal for", steps, "steps", flush=True)
    found["device"] = torch.cuda.get_device_name(device)
    for name in names:
        row = found[name]
        if name in SPEED:
            (rate,) = measure_speed([Case(name, "numba", SIZES[0])], 1, SECONDS * cores)
            row["cpu"] = {"threads": rate.threads, "steps": round(rate.env_steps_per_s)}
            for worlds in SIZES:
                try:
                    row[str(worlds)] = round(speed(name, worlds, device))
                except torch.OutOfMemoryError:
                    row[str(worlds)] = None
                torch.cuda.empty_cache()
            print(name, row, flush=True)
        out.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    typer.run(main)
