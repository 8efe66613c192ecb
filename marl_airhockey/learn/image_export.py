"""Policies that observe images as ONNX models."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from torch import nn

from marl_airhockey.learn.image_networks import ResidualBlock, Shape
from marl_airhockey.learn.onnx_export import Graph
from marl_airhockey.sim.contracts.image_form import (
    OWN,
    OWN_SIZE,
    PIXELS,
    shows_camera,
)


def save_image_policy(
    features: nn.Module,
    head: nn.Module,
    shape: Shape,
    card: dict[str, Any],
    path: Path,
) -> None:
    """Write a policy that observes images or a camera as an ONNX model.

    The inputs of a policy that observes a camera are named as the entries of an
    observation.

    Args:
        features: Layers from inputs (n, channels, H, W), see
            `image_networks.darkness`, to features (n, k).
        head: Layers from features, followed by the other inputs, to actions (n, 2).
        shape: Shape of an image.
        card: Card of the policy, with its observation type.
        path: Path of the file.
    """
    inputs: dict[str, tuple[int, ...]] = {"observation": shape}
    if shows_camera(card["observe"]):
        inputs = {PIXELS: shape, OWN: (OWN_SIZE,)}
    graph, (first, *more) = Graph(), inputs
    x = graph.node("Transpose", first, perm=[0, 3, 1, 2])
    x = graph.node("Div", x, graph.constant("white", 255.0))
    x = graph.node("Sub", graph.constant("one", 1.0), x)
    x = _add(graph, features, x, "features")
    x = graph.node("Concat", x, *more, axis=-1) if more else x
    graph.save(_add(graph, head, x, "head"), inputs, card, path)


def _add(graph: Graph, layer: nn.Module, x: str, name: str) -> str:
    """Add a layer to a graph; return the name of its result."""
    if isinstance(layer, nn.Sequential):
        for key, part in layer.named_children():
            x = _add(graph, part, x, f"{name}.{key}")
        return x
    if isinstance(layer, ResidualBlock):
        body = _add(graph, layer.body, x, f"{name}.body")
        shortcut = _add(graph, layer.shortcut, x, f"{name}.shortcut")
        return graph.node("Relu", graph.node("Add", body, shortcut))
    state = {k: v.detach().cpu().numpy() for k, v in layer.named_parameters()}
    if isinstance(layer, nn.GroupNorm):
        return _add_norm(graph, layer, x, name)
    arrays = [graph.constant(f"{name}.{k}", array) for k, array in state.items()]
    kind, attributes = _operator(layer)
    return graph.node(kind, x, *arrays, **attributes)


def _operator(layer: nn.Module) -> tuple[str, dict[str, Any]]:
    """Return the ONNX operator of a layer and its attributes."""
    if isinstance(layer, nn.Conv2d):
        pads = [int(p) for p in layer.padding] * 2
        return "Conv", {"strides": list(layer.stride), "pads": pads}
    if isinstance(layer, nn.MaxPool2d):
        size, stride, pad = layer.kernel_size, layer.stride, layer.padding
        both = {"kernel_shape": [size] * 2, "strides": [stride] * 2, "pads": [pad] * 4}
        return "MaxPool", both
    if isinstance(layer, nn.Linear):
        return "Gemm", {"transB": 1}
    plain = {
        nn.ReLU: "Relu",
        nn.Flatten: "Flatten",
        nn.AdaptiveAvgPool2d: "GlobalAveragePool",
    }
    return plain[type(layer)], {}


def _add_norm(graph: Graph, layer: nn.GroupNorm, x: str, name: str) -> str:
    """Add a group normalization, which this version of ONNX has only for instances."""
    groups, shape = layer.num_groups, graph.node("Shape", x)
    sizes = graph.integers(f"{name}.sizes", [0, groups, -1])
    ones = graph.constant(f"{name}.ones", np.ones(groups))
    zeros = graph.constant(f"{name}.zeros", np.zeros(groups))
    grouped = graph.node("Reshape", x, sizes)
    normal = graph.node(
        "InstanceNormalization", grouped, ones, zeros, epsilon=layer.eps
    )
    parts = (layer.weight, layer.bias)
    weight, bias = (p.detach().cpu().numpy()[:, None, None] for p in parts)
    scaled = graph.node(
        "Mul",
        graph.node("Reshape", normal, shape),
        graph.constant(f"{name}.weight", weight),
    )
    return graph.node("Add", scaled, graph.constant(f"{name}.bias", bias))
