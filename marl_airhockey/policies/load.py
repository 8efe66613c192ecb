"""Load policies: runs of `train`, any SB3 zip, ONNX models and .npz files."""

from __future__ import annotations

from pathlib import Path

from marl_airhockey.policies.numpy_policy import NumpyPolicy
from marl_airhockey.policies.onnx import load_onnx
from marl_airhockey.policies.policy import Policy, policy_driver
from marl_airhockey.policies.runs import policies_of
from marl_airhockey.policies.sb3 import load_sb3

ZOO = Path(__file__).parents[1] / "zoo"
"""Folder of the trained policies that come with the library"""


def policy_file(path: str | Path) -> Path:
    """Return the file of a policy, of a run's folder or of ``zoo/NAME``."""
    path = Path(path)
    if path.parent == Path("zoo") and not path.exists():
        path = ZOO / f"{path.name}.npz"
    if path.is_dir():
        kept = policies_of(path)
        path = next((file for file in kept if file.exists()), kept[0])
    return path


def load_policy(
    path: str | Path, deterministic: bool = True, trust: bool | None = None
) -> Policy:
    """Load a policy: a run of `train`, an SB3 .zip, an .onnx, an .npz, or ``zoo/NAME``.

    An SB3 zip of our training is read as plain weights. Any other holds pickled Python,
    which runs when it is loaded.

    Args:
        path: Path of the file or folder.
        deterministic: Whether to return mean actions instead of samples.
        trust: Whether pickled Python in this file may run; None to ask at a terminal
            and refuse elsewhere.

    Raises:
        ValueError: A file of another kind; the message names the expected ones; or one
            with pickled Python that is not trusted.
        RuntimeError: A missing extra; the message holds the command that installs it.
    """
    path = policy_file(path)
    if not path.exists():
        raise ValueError(f"{path}: there is no such policy file")
    if path.suffix == ".npz":
        policy = policy_driver(NumpyPolicy.load(path), str(path), deterministic)
    elif path.suffix == ".onnx":
        policy = load_onnx(path, deterministic)
    elif path.suffix == ".zip":
        policy = load_sb3(path, deterministic, trust)
    else:
        raise ValueError(
            f"{path}: expected a run folder, a stable-baselines3 .zip, an .onnx file "
            "or an .npz"
        )
    return policy
