"""Learned policy from a file: a run folder, an SB3 zip, an ONNX or an .npz file."""

from __future__ import annotations

from pathlib import Path

from marl_airhockey.toolkit.policies import Policy, load_policy


def make(
    path: str | Path, deterministic: bool = True, trust: bool | None = None
) -> Policy:
    """Load the policy; see `toolkit.policies.load_policy`."""
    return load_policy(path, deterministic, trust)
