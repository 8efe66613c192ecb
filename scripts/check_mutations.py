"""Apply small faults to a copy of the project and check that the short tests fail.

    python scripts/check_mutations.py            # all faults, some minutes
    python scripts/check_mutations.py drag gae   # faults with these words in the name

Each fault is one edit of one file. Its tests are run as in `make test`, without the
slow ones. A fault survives if no test fails; the exit status is then 1.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from marl_airhockey.sim.jit.folders import cache_folder

ROOT = Path(__file__).parents[1]


class Fault(NamedTuple):
    """Small fault, and the tests that must notice it."""

    name: str
    file: str
    """Path in the project."""
    old: str
    """Text that the file contains exactly once."""
    new: str
    tests: str
    """Paths in ``tests``, separated by spaces."""


FAULTS = [
    Fault(
        "friction pushes",
        "marl_airhockey/sim/core/laws.py",
        "min(max(-slip / tangential_mass",
        "min(max(slip / tangential_mass",
        "sim/core/test_laws.py suites/test_every_backend.py",
    ),
    Fault(
        "restitution subtracted",
        "marl_airhockey/sim/core/laws.py",
        "normal = (1.0 + restitution)",
        "normal = (1.0 - restitution)",
        "sim/core/test_laws.py suites/test_every_backend.py",
    ),
    Fault(
        "drag halved",
        "marl_airhockey/sim/core/laws.py",
        "z = drag * time *",
        "z = 0.5 * drag * time *",
        "sim/core/test_laws.py",
    ),
    Fault(
        "delay line off by one",
        "marl_airhockey/sim/sensing/delay.py",
        "return max(newer - 1, 0), max(newer, 0), 1.0 - (back - whole)",
        "return max(newer - 2, 0), max(newer - 1, 0), 1.0 - (back - whole)",
        "sim/sensing/test_delay.py sim/sensing/test_sensor.py",
    ),
    Fault(
        "stale sensor frame",
        "marl_airhockey/sim/sensing/frame.py",
        "age = errors.observation_delay[w] + errors",
        "age = view.control_dt + errors.observation_delay[w] + errors",
        "sim/sensing/test_sensor.py",
    ),
    Fault(
        "seed without i",
        "marl_airhockey/sim/core/rng.py",
        "return np.uint64(int(given)) + np.arange(worlds, dtype=np.uint64)",
        "return np.full(worlds, int(given), np.uint64)",
        "envs/test_bad_input.py",
    ),
    Fault(
        "swapped seat",
        "marl_airhockey/sim/world/driven_seat.py",
        "seats, form = np.array([self.index]), self.driver.observe",
        "seats, form = np.array([0]), self.driver.observe",
        "sim/world/test_roster.py",
    ),
    Fault(
        "acceleration not limited",
        "marl_airhockey/sim/core/limits.py",
        "fit = most / max(change, most)",
        "fit = 1.0",
        "sim/core/test_limits.py",
    ),
    Fault(
        "reward term dropped",
        "scenarios/juggle.py",
        '            "drop": -2.0 * self.terminated(t)[..., None],\n',
        "",
        "suites/test_every_scenario.py",
    ),
    Fault(
        "goal for the wrong side",
        "marl_airhockey/toolkit/versus.py",
        "t.after.crossed[..., ::-1].sum(-2)",
        "t.after.crossed.sum(-2)",
        "toolkit/test_games_rules.py",
    ),
    Fault(
        "success not latched",
        "marl_airhockey/sim/world/referee.py",
        '"success": episode["success"] | success',
        '"success": success',
        "sim/world suites/test_every_goal_scenario.py",
    ),
    Fault(
        "time limit reported as an end",
        "marl_airhockey/sim/world/referee.py",
        '"terminated": terminated,',
        '"terminated": terminated | over,',
        "suites/test_every_scenario.py envs",
    ),
    Fault(
        "exporter drops a layer",
        "marl_airhockey/policies/torch_weights.py",
        "        for name in layers\n",
        "        for name in layers if name != layers[1]\n",
        "learn/test_runs.py learn/test_offline.py policies/test_load.py",
    ),
    Fault(
        "gae ignores the end",
        "marl_airhockey/learn/advantages.py",
        "td_error = reward[t] + gamma * last_value * not_done[t] - value[t]",
        "td_error = reward[t] + gamma * last_value - value[t]",
        "learn/test_ppo.py",
    ),
    Fault(
        "expectile upside down",
        "marl_airhockey/learn/offline/iql.py",
        "advantage > 0, self.config.expectile",
        "advantage < 0, self.config.expectile",
        "learn/test_offline_losses.py",
    ),
    Fault(
        "arm beyond its limits",
        "marl_airhockey/hardware/robot/shaper.py",
        "        if self._can_brake(wish):\n            return wish\n",
        "        return wish\n",
        "hardware/test_shaper.py",
    ),
    Fault(
        "camera upside down",
        "marl_airhockey/hardware/vision/lens.py",
        "self.centre[:2] + steps[:, None] * directions[:, :2]",
        "self.centre[:2] - steps[:, None] * directions[:, :2]",
        "hardware/test_vision.py",
    ),
    Fault(
        "recording loses a step",
        "marl_airhockey/data/writer.py",
        "        self._step += count\n",
        "        self._step += 1\n",
        "data/test_recording_files.py",
    ),
    Fault(
        "rating of the loser",
        "marl_airhockey/evaluation/league.py",
        "score[b, a] = played[a, b] - score[a, b]",
        "score[b, a] = score[a, b]",
        "evaluation/test_league.py",
    ),
    Fault(
        "own paddle forgotten",
        "marl_airhockey/toolkit/observables.py",
        "out[...] = (ego.puck_predicted[0] - ego.own[..., None, :]).reshape(out.shape)",
        "out[...] = ego.puck_predicted[0].reshape(out.shape)",
        "toolkit/test_observables.py",
    ),
    Fault(
        "falling pucks reach a goal",
        "scenarios/hit_goal.py",
        "return 1.0 * (near & (achieved[..., 2] > 0.5))",
        "return 1.0 * near",
        "suites/test_every_goal_scenario.py toolkit/test_aiming_tasks.py",
    ),
    Fault(
        "true memory is sensed",
        "marl_airhockey/sim/world/sensed_memory.py",
        "for name in self._scenario.announced",
        "for name in new",
        "sim/sensing/test_sensed_contacts.py",
    ),
    Fault(
        "robot resumes automatically",
        "marl_airhockey/hardware/robot/supervisor.py",
        "self._must_let_go |= fault in LATCHED",
        "self._must_let_go |= False",
        "hardware/emulated/test_emulated_robot.py",
    ),
    Fault(
        "a driver recovers by an old word",
        "marl_airhockey/hardware/robot/driver.py",
        "if before is not DriverState.FAULT:",
        "if False:",
        "hardware/emulated/test_emulated_robot.py",
    ),
    Fault(
        "last step is not recorded",
        "marl_airhockey/rollouts/collector.py",
        "value[i, :length] for",
        "value[i, : length - 1] for",
        "data/test_record.py",
    ),
    Fault(
        "critics are optimistic",
        "marl_airhockey/learn/offline/td3_bc.py",
        "torch.cat([after, action], -1)).amin(0)",
        "torch.cat([after, action], -1)).amax(0)",
        "learn/test_offline_losses.py",
    ),
    Fault(
        "force mode stays on",
        "marl_airhockey/hardware/robot/driver.py",
        "self._arm.release(self._motion.pose)",
        "pass",
        "hardware/emulated/test_rest.py",
    ),
    Fault(
        "speed slider ignored",
        "marl_airhockey/hardware/robot/motion.py",
        "self.shaper.scale_speed(self.scaling)",
        "self.shaper.scale_speed(1.0)",
        "hardware/emulated/test_speed_slider.py",
    ),
    Fault(
        "target runs ahead of the arm",
        "marl_airhockey/hardware/robot/motion.py",
        "> self.most\n        if too_far:",
        "> 9.0 * self.most\n        if too_far:",
        "hardware/test_motion.py",
    ),
    Fault(
        "mirrored mounting accepted",
        "marl_airhockey/hardware/robot/mounting.py",
        " or np.linalg.det(rotation) < 0.0",
        "",
        "hardware/test_rig.py",
    ),
    Fault(
        "repeated pictures searched",
        "marl_airhockey/hardware/vision/watcher.py",
        "None if repeated else self._detector.find(frame)",
        "self._detector.find(frame)",
        "hardware/lab/test_no_news.py",
    ),
    Fault(
        "two clients write one input",
        "marl_airhockey/hardware/ur_emulator/rtde_connection.py",
        "if not recipe.known or TAKEN in types:",
        "if not recipe.known:",
        "hardware/lab/test_ur_protocol.py",
    ),
]


def faults_of(faults: Sequence[Fault]) -> list[str]:
    """Return errors of faults: a text that is not there exactly once, or no test."""
    wrong = []
    for fault in faults:
        path = ROOT / fault.file
        if not path.exists() or path.read_text().count(fault.old) != 1:
            wrong.append(f"{fault.name}: {fault.file} must contain its text once")
        paths = [ROOT / "tests" / name for name in fault.tests.split()]
        wrong += [f"{fault.name}: {p} does not exist" for p in paths if not p.exists()]
    return wrong


def copied(folder: Path) -> None:
    """Copy the files that git lists, and new files, into a folder."""
    listed = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    done = subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=True)
    for name in done.stdout.splitlines():
        source, target = ROOT / name, folder / name
        if source.is_file():
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(source, target, follow_symlinks=False)


def tested(folder: Path, cache: Path, tests: str) -> subprocess.CompletedProcess[str]:
    """Run some tests of a copy until the first failure."""
    paths = [f"tests/{path}" for path in tests.split()]
    command = [sys.executable, "-m", "pytest", "-x", "-m", "not slow", *paths]
    variables = {"PYTHONPATH": str(folder), "MARL_AIRHOCKEY_CACHE": str(cache)}
    return subprocess.run(
        command,
        cwd=folder,
        env={**os.environ, **variables},
        capture_output=True,
        text=True,
    )


def failed_test(output: str) -> str:
    """Return the first test that failed, or the last line of the output."""
    lines = output.splitlines()
    found = [line for line in lines if line.startswith(("FAILED", "ERROR"))]
    return (found or lines[-1:] or [""])[0].split(" - ")[0]


def survives(fault: Fault, folder: Path, cache: Path) -> bool:
    """Apply a fault, run its tests, print the result, and remove the fault."""
    path = folder / fault.file
    text, began = path.read_text(), time.monotonic()
    path.write_text(text.replace(fault.old, fault.new))
    done = tested(folder, cache, fault.tests)
    path.write_text(text)
    if done.returncode not in (0, 1):
        raise RuntimeError(f"{fault.name}: {done.stdout}{done.stderr}")
    seconds = time.monotonic() - began
    if done.returncode:
        print(f"killed    {fault.name:32} {seconds:4.0f} s  {failed_test(done.stdout)}")
    else:
        print(f"SURVIVED  {fault.name:32} {seconds:4.0f} s", flush=True)
    return not done.returncode


def main() -> None:
    """Apply the faults that the command line names, or all of them."""
    words = sys.argv[1:]
    faults = [f for f in FAULTS if not words or any(word in f.name for word in words)]
    if wrong := faults_of(faults):
        sys.exit("\n".join(wrong))
    with tempfile.TemporaryDirectory() as name:
        folder, cache = Path(name) / "project", Path(name) / "cache"
        copied(folder)
        # Faults outside of compiled code use the compiled code of the project.
        shutil.copytree(cache_folder(), cache, symlinks=True)
        survivors = [fault.name for fault in faults if survives(fault, folder, cache)]
    print(f"{len(faults) - len(survivors)} of {len(faults)} faults killed")
    sys.exit(bool(survivors))


if __name__ == "__main__":
    main()
