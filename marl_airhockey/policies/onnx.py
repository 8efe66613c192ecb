"""ONNX models as policies."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.core.errors import require
from marl_airhockey.policies.card import current_card
from marl_airhockey.policies.policy import Policy, trained_in
from marl_airhockey.types import Array

ONNX_CARD = "card"
"""Name of the metadata of an ONNX model that holds the card of a policy of ours"""


class _OnnxModel:
    """ONNX model; copies and pickles hold its bytes and open a new session."""

    def __init__(self, source: str, content: bytes) -> None:
        self._source, self._content = source, content
        self._open()

    def __getstate__(self) -> tuple[str, bytes]:
        return self._source, self._content

    def __setstate__(self, state: tuple[str, bytes]) -> None:
        self._source, self._content = state
        self._open()

    def _open(self) -> None:
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1
        self._session = onnxruntime.InferenceSession(
            self._content, options, providers=["CPUExecutionProvider"]
        )
        self.inputs = self._session.get_inputs()

    @property
    def card(self) -> dict[str, Any]:
        """Card of a policy of ours; empty for other models."""
        metadata = self._session.get_modelmeta().custom_metadata_map
        try:
            found = json.loads(metadata.get(ONNX_CARD, "{}"))
        except ValueError:
            return {}
        return current_card(found) if isinstance(found, dict) else {}

    def __call__(self, observation: Any, deterministic: bool) -> Array:
        rows = np.asarray(observation, np.float32)
        out = np.asarray(self._session.run(None, {self.inputs[0].name: rows})[0])
        if out.shape != (len(rows), 2):
            raise ValueError(
                f"{self._source}: expected actions of shape {(len(rows), 2)}, got "
                f"{out.shape}"
            )
        return out


def load_onnx(path: Path, deterministic: bool) -> Policy:
    """Load an ONNX model with one input, observations (B, D), as a policy.

    Raises:
        ValueError: Another kind of file or model.
        RuntimeError: onnxruntime is missing; the message says how to install it.
    """
    require("onnxruntime", "offline")
    try:
        model = _OnnxModel(str(path), path.read_bytes())
    except Exception as error:
        raise ValueError(f"{path}: not an ONNX model: {error}") from error
    if len(model.inputs) != 1:
        raise ValueError(f"{path}: expected one input, found {len(model.inputs)}")
    sizes = model.inputs[0].shape[1:]
    shape = tuple(n for n in sizes if isinstance(n, int))
    known = shape if len(shape) == len(sizes) else None
    card = model.card
    policy = Policy(model, known, card.get("observe"), str(path), deterministic)
    policy.trained_in, policy.can_sample = trained_in(card), False
    return policy
