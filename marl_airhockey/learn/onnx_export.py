"""Policies in the ONNX format, which robots' runtimes and other languages read."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from marl_airhockey.policies.numpy_policy import NumpyPolicy
from marl_airhockey.policies.onnx import ONNX_CARD

OPSET = 17
"""Version of the operators, which runtimes from 2022 on know"""


def save_onnx(policy: NumpyPolicy, path: Path) -> None:
    """Write a policy as an ONNX model; the file is replaced atomically.

    Its input ``observation`` is (B, D) float32, goals that are given apart after the
    rest; its output ``action`` is (B, 2) float32, the mean action within -1 .. 1.
    The policy's card is the model's metadata ``card``, as JSON.
    """
    nodes: list[onnx.NodeProto] = []
    constants: list[onnx.TensorProto] = []

    def constant(name: str, value: object) -> str:
        array = np.asarray(value, np.float32)
        constants.append(numpy_helper.from_array(array, name))
        return name

    def node(kind: str, *inputs: str) -> str:
        name = f"value_{len(nodes)}"
        nodes.append(helper.make_node(kind, list(inputs), [name]))
        return name

    x = node("Sub", "observation", constant("centre", policy.centre))
    x = node("Div", x, constant("unit", policy.unit))
    for i, (weight, bias) in enumerate(policy.layers):
        if i:
            x = node("Relu", x)
        arrays = constant(f"weight_{i}", weight.T), constant(f"bias_{i}", bias)
        x = node("Gemm", x, *arrays)
    if policy.card.get("bounded"):
        x = node("Tanh", x)
    bounds = constant("low", -1.0), constant("high", 1.0)
    nodes.append(helper.make_node("Clip", [x, *bounds], ["action"]))
    shapes = {"observation": len(policy.centre), "action": 2}
    given, made = (
        helper.make_tensor_value_info(name, TensorProto.FLOAT, ["batch", size])
        for name, size in shapes.items()
    )
    graph = helper.make_graph(nodes, "policy", [given], [made], constants)
    model = helper.make_model(
        graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=8
    )
    helper.set_model_props(model, {ONNX_CARD: json.dumps(dict(policy.card))})
    onnx.checker.check_model(model)
    draft = path.with_name(f"part-{path.name}")
    draft.write_bytes(model.SerializeToString())
    draft.replace(path)
