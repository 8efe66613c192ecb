"""Policies from ONNX models."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.policies.policy import Policy, trained_in
from marl_airhockey.sim.contracts.image_form import OWN, PIXELS
from marl_airhockey.sim.core.errors import require
from marl_airhockey.types import Array

ONNX_CARD = "card"
"""Key of the metadata of an ONNX model that contains the card of a policy."""


class _OnnxModel:
    """ONNX model. Copies and pickles contain its bytes and open a new session."""

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
        """Card of a policy of this library; empty for other models."""
        metadata = self._session.get_modelmeta().custom_metadata_map
        try:
            found = json.loads(metadata.get(ONNX_CARD, "{}"))
        except ValueError:
            return {}
        return found if isinstance(found, dict) else {}

    def __call__(self, observation: Any, deterministic: bool) -> Array:
        names = [given.name for given in self.inputs]
        parts = (
            [observation[name] for name in names]
            if isinstance(observation, Mapping)
            else [observation]
        )
        rows = [np.asarray(part, np.float32) for part in parts]
        if self.inputs[0].shape[0] == 1:  # Its batch size is fixed.
            single = ([part[i : i + 1] for part in rows] for i in range(len(rows[0])))
            return np.concatenate([self._actions(names, row) for row in single])
        return self._actions(names, rows)

    def _actions(self, names: list[str], rows: list[Array]) -> Array:
        inputs = dict(zip(names, rows, strict=True))
        out, shape = np.asarray(self._session.run(None, inputs)[0]), (len(rows[0]), 2)
        if out.shape != shape:
            raise ValueError(
                f"{self._source}: expected actions of shape {shape}, got {out.shape}"
            )
        return out

    def check(self) -> None:
        """Check that the model can be a policy.

        Raises:
            ValueError: The inputs or outputs are different. The message names them.
        """
        if {given.name for given in self.inputs} == {PIXELS, OWN}:
            return  # It observes a camera.
        expected = f"{self._source}: expected one input, float32 (B, D)"
        if len(self.inputs) != 1:
            raise ValueError(f"{expected}; found {len(self.inputs)} inputs")
        kind, shape = self.inputs[0].type, self.inputs[0].shape
        if kind != "tensor(float)" or len(shape) < 2:
            raise ValueError(f"{expected}; found {kind} of shape {shape}")
        if isinstance(shape[0], int) and shape[0] != 1:
            raise ValueError(
                f"{expected}; its batch size is fixed to {shape[0]}: export it with a "
                "dynamic first axis, or with 1"
            )
        if all(isinstance(size, int) for size in shape[1:]):
            self(np.zeros((2, *shape[1:])), deterministic=True)


def load_onnx(path: Path, deterministic: bool) -> Policy:
    """Load an ONNX model with one input, observations (B, D), as a policy.

    A model with a fixed batch size of 1 is called for one row at a time.

    Raises:
        ValueError: The file or the model is of another kind.
        RuntimeError: onnxruntime is missing. The message states how to install it.
    """
    require("onnxruntime", "offline")
    try:
        model = _OnnxModel(str(path), path.read_bytes())
    except Exception as error:
        raise ValueError(f"{path}: not an ONNX model: {error}") from error
    model.check()
    sizes = model.inputs[0].shape[1:]
    shape = tuple(n for n in sizes if isinstance(n, int))
    known = shape if len(shape) == len(sizes) else None
    card = model.card
    policy = Policy(model, known, card.get("observe"), str(path), deterministic)
    policy.trained_in, policy.can_sample = trained_in(card), False
    return policy
