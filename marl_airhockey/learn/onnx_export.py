"""Policies in the ONNX format, which many runtimes and programming languages read."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from marl_airhockey.policies.numpy_policy import NumpyPolicy
from marl_airhockey.policies.onnx import ONNX_CARD

OPSET = 17
"""Version of the operators, which runtimes from 2022 or later support."""


class Graph:
    """Graph of operations on the inputs of a policy."""

    def __init__(self) -> None:
        self._nodes: list[onnx.NodeProto] = []
        self._constants: list[onnx.TensorProto] = []

    def constant(self, name: str, value: object) -> str:
        """Add a constant array; return its name."""
        array = np.asarray(value, np.float32)
        self._constants.append(numpy_helper.from_array(array, name))
        return name

    def integers(self, name: str, value: list[int]) -> str:
        """Add a constant list of integers; return its name."""
        array = np.array(value, np.int64)
        self._constants.append(numpy_helper.from_array(array, name))
        return name

    def node(self, kind: str, *inputs: str, **attributes: Any) -> str:
        """Add an operation on values; return the name of its result."""
        name = f"value_{len(self._nodes)}"
        node = helper.make_node(kind, list(inputs), [name], **attributes)
        self._nodes.append(node)
        return name

    def save(
        self,
        last: str,
        inputs: Mapping[str, tuple[int, ...]],
        card: Mapping[str, Any],
        path: Path,
    ) -> None:
        """Write the model of a policy; the file is replaced atomically.

        Args:
            last: Name of the value that is the action before clipping.
            inputs: Shape of a row of each input, by name.
            card: Card of the policy.
            path: Path of the file.
        """
        bounds = self.constant("low", -1.0), self.constant("high", 1.0)
        self._nodes.append(helper.make_node("Clip", [last, *bounds], ["action"]))
        *given, made = (
            helper.make_tensor_value_info(name, TensorProto.FLOAT, ["batch", *sizes])
            for name, sizes in (*inputs.items(), ("action", (2,)))
        )
        graph = helper.make_graph(self._nodes, "policy", given, [made], self._constants)
        model = helper.make_model(
            graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=8
        )
        helper.set_model_props(model, {ONNX_CARD: json.dumps(dict(card))})
        onnx.checker.check_model(model)
        draft = path.with_name(f"part-{path.name}")
        draft.write_bytes(model.SerializeToString())
        draft.replace(path)


def save_onnx(policy: NumpyPolicy, path: Path) -> None:
    """Write a policy as an ONNX model.

    The input ``observation`` is (B, D) float32. Goals of goals="dict" follow the flat
    observation. The output ``action`` is (B, 2) float32, the mean action clipped to -1
    .. 1. The card of the policy is stored as JSON in the metadata ``card`` of the
    model.
    """
    graph = Graph()
    x = graph.node("Sub", "observation", graph.constant("centre", policy.centre))
    x = graph.node("Div", x, graph.constant("unit", policy.unit))
    for i, (weight, bias) in enumerate(policy.layers):
        if i:
            x = graph.node("Relu", x)
        arrays = weight.T, bias
        names = f"weight_{i}", f"bias_{i}"
        x = graph.node("Gemm", x, *map(graph.constant, names, arrays))
    if policy.card.get("bounded"):
        x = graph.node("Tanh", x)
    graph.save(x, {"observation": (len(policy.centre),)}, policy.card, path)
