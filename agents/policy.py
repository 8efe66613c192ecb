"""A learned policy from a file: a run folder, an SB3 zip or an ONNX file."""

from __future__ import annotations

from pathlib import Path

from marl_airhockey.toolkit.policies import Policy, load_policy


def make(path: str | Path, deterministic: bool = True) -> Policy:
    """Load the policy; see `learn.policy.load_policy`."""
    return load_policy(path, deterministic)
