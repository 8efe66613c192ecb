"""Policies from models of stable-baselines3."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.policies.numpy_policy import NumpyPolicy
from marl_airhockey.policies.policy import Policy, policy_driver, trained_in
from marl_airhockey.policies.runs import check_run_format
from marl_airhockey.policies.torch_weights import policy_of_weights
from marl_airhockey.policies.trust import require_trust
from marl_airhockey.sim.contracts.image_form import image_form, shows_images
from marl_airhockey.sim.core.errors import require
from marl_airhockey.types import Array


def load_sb3(path: Path, deterministic: bool, trust: bool | None) -> Policy:
    """Load a zip of stable-baselines3 as a policy.

    A zip of `airhockey train`, except for images, is read as plain weights. Any other
    zip contains pickled Python code, which runs if it is trusted, see
    `trust.require_trust`.

    Raises:
        ValueError: The file or the model is of another kind, or it is not trusted.
        RuntimeError: stable-baselines3 is missing. The message states how to install
            it.
    """
    require("stable_baselines3", "train")
    wrong = f"{path}: not a stable-baselines3 policy"
    try:
        with zipfile.ZipFile(path) as archive:
            data = json.loads(archive.read("data"))
        module = data["policy_class"]["__module__"]
    except (zipfile.BadZipFile, KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{wrong} ({error})") from error
    card = data.get("card")
    if isinstance(card, dict):  # A zip of this library.
        check_run_format(path, card.get("run_format", 1))
        if not shows_images(card.get("observe")):
            own = numpy_actor(load_weights(path), card)
            return policy_driver(own, str(path), deterministic)
    require_trust(path, trust)
    import stable_baselines3 as sb3

    families: dict[str, Any] = {"sac": sb3.SAC, "td3": sb3.TD3, "common": sb3.PPO}
    kinds = [kind for name, kind in families.items() if f".{name}." in module]
    if not kinds:
        raise ValueError(f"{wrong} of PPO, A2C, SAC, TD3 or DDPG (found {module})")
    try:
        # A policy does not need the schedules of training.
        plain = {"lr_schedule": lambda _: 0.0, "clip_range": lambda _: 0.0}
        model = kinds[0].load(path, device="cpu", custom_objects=plain)
    except Exception as error:
        raise ValueError(f"{wrong}: {error}") from error
    if model.action_space.shape != (2,):
        raise ValueError(f"{path}: action space {model.action_space}; expected (2,)")
    card = getattr(model, "card", {})
    observe, shape = card.get("observe"), model.observation_space.shape
    if shows_images(observe):  # The model's own space has the channels first.
        shape = image_form(observe).shape
    return Policy(
        partial(_predict_sb3, model.policy),
        shape,
        observe,
        str(path),
        deterministic,
        trained_in=model_environment(model),
    )


def model_environment(model: Any) -> dict[str, Any]:
    """Return the environment in which a model was trained, see `trained_in`.

    Args:
        model: Model of stable-baselines3, or another object that may have a ``card`` or
            an ``observation_space``.
    """
    card = getattr(model, "card", None)
    known = trained_in(card if isinstance(card, Mapping) else {})
    spaces = getattr(getattr(model, "observation_space", None), "spaces", None)
    if isinstance(spaces, Mapping) and "desired_goal" in spaces:
        return {**known, "goals": "dict"}
    return known


def _predict_sb3(policy: Any, observation: Any, deterministic: bool) -> Array:
    return np.asarray(policy.predict(observation, deterministic=deterministic)[0])


def numpy_actor(weights: Mapping[str, Any], card: Mapping[str, Any]) -> NumpyPolicy:
    """Return the actor of a model that this library trained, as plain arrays.

    Args:
        weights: Tensors by their names in the model's policy.
        card: Card of the policy.

    Raises:
        ValueError: The model is for images, or has other layers.
    """
    layers = [f"mlp_extractor.policy_net.{2 * i}" for i in range(len(weights))]
    layers = [*(name for name in layers if f"{name}.weight" in weights), "action_net"]
    try:
        rate = weights["features_extractor.rate"]
        scale = weights["features_extractor.centre"], 1.0 / rate
        return policy_of_weights(weights, layers, scale, weights["log_std"], card)
    except KeyError as error:
        raise ValueError(
            f"this policy cannot be stored as .npz (it has no {error}); expected one "
            "for flat observations or goals, with ReLU layers"
        ) from error


def load_weights(path: Path) -> Mapping[str, Any]:
    """Read the tensors of a zip of stable-baselines3 without running code in it.

    Raises:
        ValueError: The zip has other contents.
    """
    import torch

    try:
        with zipfile.ZipFile(path) as archive:
            content = io.BytesIO(archive.read("policy.pth"))
        found = torch.load(content, map_location="cpu", weights_only=True)
        return dict(found)
    except Exception as error:  # A broken or hostile file can raise any error.
        kind = type(error).__name__
        raise ValueError(f"{path}: it contains no plain weights ({kind})") from error
