"""Loading of policies: run folders, zips of SB3, ONNX models and .npz files."""

from __future__ import annotations

from pathlib import Path

from marl_airhockey.policies.numpy_policy import NumpyPolicy
from marl_airhockey.policies.onnx import load_onnx
from marl_airhockey.policies.policy import Policy, policy_driver
from marl_airhockey.policies.runs import policies_of
from marl_airhockey.policies.sb3 import load_sb3

ZOO = Path(__file__).parents[1] / "zoo"
"""Folder of the trained policies of this library."""


def policy_file(path: str | Path) -> Path:
    """Return the policy file for its path, a run folder or ``zoo/NAME``."""
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
    """Load a policy: a run folder, a zip of SB3, an .onnx, an .npz, or ``zoo/NAME``.

    A zip of `airhockey train`, except for images, is read as plain weights. Any other
    zip contains pickled Python code, which runs when it is loaded.

    Args:
        path: Path of the file or folder.
        deterministic: True to return mean actions, False to return samples.
        trust: True to allow pickled Python code in this file to run. None to ask at a
            terminal, and to raise an error elsewhere.

    Raises:
        ValueError: There is no such file, it is of another kind, or it contains Python
            code that is not trusted.
        RuntimeError: An extra is missing. The message states how to install it.
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
