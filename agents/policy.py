"""Learned policy from a file: a run folder, an SB3 zip, an ONNX or an .npz file."""

from __future__ import annotations

from pathlib import Path

from marl_airhockey.toolkit.policies import Policy, load_policy


def make(path: str | Path, deterministic: bool = True) -> Policy:
    """Load the policy; see `toolkit.policies.load_policy`."""
    # Whether its code is trusted is no option: names come from plans and configs, too.
    return load_policy(path, deterministic)
