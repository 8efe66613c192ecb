"""Policies from files: runs of `train`, any SB3 zip, ONNX models and .npz files."""

from __future__ import annotations

import io
import json
import tomllib
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from marl_airhockey.contracts.driver import Driver, View
from marl_airhockey.core.errors import require
from marl_airhockey.toolkit.numpy_policy import NumpyPolicy
from marl_airhockey.toolkit.trust import require_trust
from marl_airhockey.types import Array

ZOO = Path(__file__).parents[1] / "zoo"
"""Folder of the trained policies that come with the library"""
Predict = Callable[[Any, bool], Array]
RUN_FORMAT = 2
"""Format of a run's folder, in its ``config.toml`` and in the card of its zips.

Raised whenever classes that a run pickles, or settings that it names, move: runs of
another format are refused.
"""
KINDS = ("npz", "zip")
"""File name extensions of the policies that engines write, the harmless one first."""


@dataclass
class Policy(Driver):
    """Learned policy as a driver.

    Outside of environments, ``predict`` is the policy itself: it takes observations
    (B, D) as the environment of its training gives them, and whether to return the mean
    action, and returns actions (B, 2), fractions of top speed in the ego frame. They
    may lie a little beyond -1 .. 1, where environments clip them.

    Args:
        predict: function (observation (B, ...), deterministic) -> action (B, 2).
        shape: of the observation that it was trained on; None if unknown.
        observe: form of that observation; None for the environment's.
        source: origin of the policy, for messages.
        deterministic: return the mean action instead of a sample.
    """

    predict: Predict
    shape: tuple[int, ...] | None = None
    observe: str | None = None
    source: str = "policy"
    deterministic: bool = True
    noise: Array | None = None
    """Standard deviation of sampled actions (2,), if `predict` returns only means"""
    can_sample: bool = True
    """False if it has a mean action alone, as ONNX models"""
    trained_in: Mapping[str, Any] = field(default_factory=dict)
    """Environment of its training, as far as it is known, see `trained_in`"""

    def act(
        self, view: View, memory: dict[str, Array]
    ) -> tuple[Array, dict[str, Array]]:
        action = self._actions(view.observation)
        if self.noise is not None and not self.deterministic:
            action += self.noise * view.rng.normal(2)
        return np.clip(action, -1.0, 1.0), memory

    def check(self, observation: Array | Mapping[str, Array]) -> None:
        if isinstance(observation, Mapping):
            shape: tuple[int, ...] = (sum(x.shape[1] for x in observation.values()),)
        else:
            shape = observation.shape[1:]
        if self.shape not in (None, shape):
            raise ValueError(
                f"{self.source}: it expects observations of shape {self.shape}, "
                f"this environment gives {shape}; it was trained on another "
                "scenario, or with other options (observe, goals, reaction, seats)"
            )

    def _actions(self, observation: Any) -> Array:
        return np.asarray(self.predict(observation, self.deterministic), np.float64)


TRAINED_IN: dict[str, type | tuple[type, ...]] = {
    "scenario": str,
    "profile": str,
    "options": dict,
    "physics": dict,
    "drivers": dict,
    "control_dt": (int, float),
    "goals": str,
}
"""What describes the environment of a training, and its types"""


def trained_in(card: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a policy's card or a run's settings say of its environment.

    Returns:
        The scenario's name, and keywords of environments; without what is not there or
        is of another type, as files come from anywhere.
    """
    return {
        name: card[name]
        for name, kind in TRAINED_IN.items()
        if isinstance(card.get(name), kind)
    }


def load_policy(
    path: str | Path, deterministic: bool = True, trust: bool | None = None
) -> Policy:
    """Load a policy: a run of `train`, an SB3 .zip, an .onnx, an .npz, or ``zoo/NAME``.

    An SB3 zip of our training is read as plain weights. Any other holds pickled Python,
    which runs when it is loaded.

    Args:
        path: of the file or folder.
        deterministic: return mean actions instead of samples.
        trust: whether pickled Python in this file may run; None to ask at a terminal
            and refuse elsewhere.

    Raises:
        ValueError: a file of another kind; the message names the expected ones; or one
            with pickled Python that is not trusted.
        RuntimeError: a missing extra; the message holds the command that installs it.
    """
    path = Path(path)
    if path.parent == Path("zoo") and not path.exists():
        path = ZOO / f"{path.name}.npz"
    if path.is_dir():
        kept = policies_of(path)
        path = next((file for file in kept if file.exists()), kept[0])
    if not path.exists():
        raise ValueError(f"{path}: there is no such policy file")
    if path.suffix == ".npz":
        policy = policy_driver(NumpyPolicy.load(path), str(path), deterministic)
    elif path.suffix == ".onnx":
        policy = _load_onnx(path, deterministic)
    elif path.suffix == ".zip":
        policy = _load_sb3(path, deterministic, trust)
    else:
        raise ValueError(
            f"{path}: expected a run folder, a stable-baselines3 .zip, an .onnx file "
            "or an .npz"
        )
    # Cards of older runs say less than the settings beside them.
    policy.trained_in = {**_run_settings(path.parent), **policy.trained_in}
    return policy


def _run_settings(folder: Path) -> dict[str, Any]:
    """Return what the settings in a run's folder say of its environment, if any."""
    try:
        return trained_in(tomllib.loads((folder / "config.toml").read_text()))
    except (OSError, ValueError):
        return {}


def policies_of(run: Path) -> list[Path]:
    """Return the paths that a run's policies may have, the one to take first."""
    return [run / f"{name}.{kind}" for kind in KINDS for name in ("best", "last")]


def check_run_format(source: Path, found: int) -> None:
    """Refuse a run of another format than `RUN_FORMAT`.

    Raises:
        ValueError: another format.
    """
    if found != RUN_FORMAT:
        raise ValueError(
            f"{source}: this run was begun by another version of marl_airhockey (run "
            f"format {found}, this version reads {RUN_FORMAT}); train it anew in "
            "another folder"
        )


def policy_driver(
    policy: NumpyPolicy, source: str, deterministic: bool = True
) -> Policy:
    """Return a NumPy policy as a driver."""
    return Policy(
        policy,
        policy.centre.shape,
        policy.card.get("observe"),
        source,
        deterministic,
        np.exp(policy.log_std),
        trained_in=trained_in(policy.card),
    )


def numpy_actor(weights: Mapping[str, Any], card: Mapping[str, Any]) -> NumpyPolicy:
    """Return the actor of a model of our training as plain arrays.

    Args:
        weights: tensors by their names in the model's policy.
        card: description of the policy.

    Raises:
        ValueError: another kind of model: pixels, other layers.
    """
    layers = [f"mlp_extractor.policy_net.{2 * i}" for i in range(len(weights))]
    layers = [*(name for name in layers if f"{name}.weight" in weights), "action_net"]
    try:

        def array(name: str) -> Array:
            return np.array(weights[name].detach().cpu().numpy(), np.float32)

        centre, rate = (array(f"features_extractor.{n}") for n in ("centre", "rate"))
        pairs = [(array(f"{n}.weight"), array(f"{n}.bias")) for n in layers]
        log_std = array("log_std")
    except KeyError as error:
        raise ValueError(
            f"no .npz holds this policy (it has no {error}): only those on flat "
            "observations or goals, with ReLU layers"
        ) from error
    return scaled_policy(pairs, centre, 1.0 / rate, log_std, card)


def scaled_policy(
    layers: Sequence[tuple[Array, Array]],
    centre: Array,
    unit: Array,
    log_std: Array,
    card: Mapping[str, Any],
) -> NumpyPolicy:
    """Return a policy whose goals, if it has some, follow the flat part as they are.

    Args:
        layers: see `NumpyPolicy`.
        centre: (D,) of the flat part.
        unit: (D,) of the flat part.
        log_std: see `NumpyPolicy`.
        card: see `NumpyPolicy`.
    """
    goals = (0, layers[0][0].shape[1] - len(centre))
    unit = np.pad(unit, goals, constant_values=1.0)
    return NumpyPolicy(layers, np.pad(centre, goals), unit, log_std, card)


def load_weights(path: Path) -> Mapping[str, Any]:
    """Read the tensors of a zip of stable-baselines3, running nothing in it.

    Raises:
        ValueError: a zip that holds something else.
    """
    import torch

    try:
        with zipfile.ZipFile(path) as archive:
            content = io.BytesIO(archive.read("policy.pth"))
        found = torch.load(content, map_location="cpu", weights_only=True)
        return dict(found)
    except Exception as error:  # Whatever a broken or hostile file makes of it.
        kind = type(error).__name__
        raise ValueError(f"{path}: it holds no plain weights ({kind})") from error


def _load_sb3(path: Path, deterministic: bool, trust: bool | None) -> Policy:
    require("stable_baselines3", "train")
    wrong = f"{path}: not a stable-baselines3 policy"
    try:
        with zipfile.ZipFile(path) as archive:
            data = json.loads(archive.read("data"))
        module = data["policy_class"]["__module__"]
    except (zipfile.BadZipFile, KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{wrong} ({error})") from error
    if "card" in data:  # of our own training
        check_run_format(path, data["card"].get("run_format", 1))
        if data["card"].get("observe") != "pixels":
            own = numpy_actor(load_weights(path), data["card"])
            return policy_driver(own, str(path), deterministic)
    require_trust(path, trust)
    import stable_baselines3 as sb3

    families: dict[str, Any] = {"sac": sb3.SAC, "td3": sb3.TD3, "common": sb3.PPO}
    kinds = [kind for name, kind in families.items() if f".{name}." in module]
    if not kinds:
        raise ValueError(f"{wrong} of PPO, A2C, SAC, TD3 or DDPG (found {module})")
    try:
        # Training schedules are dropped: a policy does not need them.
        plain = {"lr_schedule": lambda _: 0.0, "clip_range": lambda _: 0.0}
        model = kinds[0].load(path, device="cpu", custom_objects=plain)
    except Exception as error:
        raise ValueError(f"{wrong}: {error}") from error
    if model.action_space.shape != (2,):
        raise ValueError(f"{path}: its action space is {model.action_space}, not (2,)")
    card = getattr(model, "card", {})

    return Policy(
        partial(_predict_sb3, model.policy),
        model.observation_space.shape,
        card.get("observe"),
        str(path),
        deterministic,
        trained_in=model_environment(model),
    )


def model_environment(model: Any) -> dict[str, Any]:
    """Return what a model says of the environment of its training, see `trained_in`.

    Args:
        model: of stable-baselines3, or anything else with a ``card`` or an
            ``observation_space``.
    """
    card = getattr(model, "card", None)
    known = trained_in(card if isinstance(card, Mapping) else {})
    spaces = getattr(getattr(model, "observation_space", None), "spaces", None)
    if isinstance(spaces, Mapping) and "desired_goal" in spaces:
        return {**known, "goals": "dict"}
    return known


def _predict_sb3(policy: Any, observation: Any, deterministic: bool) -> Array:
    return np.asarray(policy.predict(observation, deterministic=deterministic)[0])


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
        return found if isinstance(found, dict) else {}

    def __call__(self, observation: Any, deterministic: bool) -> Array:
        rows = np.asarray(observation, np.float32)
        out = np.asarray(self._session.run(None, {self.inputs[0].name: rows})[0])
        if out.shape != (len(rows), 2):
            raise ValueError(
                f"{self._source}: expected actions of shape {(len(rows), 2)}, got "
                f"{out.shape}"
            )
        return out


def _load_onnx(path: Path, deterministic: bool) -> Policy:
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
