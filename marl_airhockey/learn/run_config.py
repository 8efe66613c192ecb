"""Settings that the runs of all algorithms have, and their TOML form."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, fields
from typing import Any, ClassVar

from marl_airhockey.policies.policy import trained_in
from marl_airhockey.policies.runs import RUN_FORMAT
from marl_airhockey.registry import DEFAULT_BACKEND
from marl_airhockey.sim.core.checks import check_fields
from marl_airhockey.sim.world.keywords import Keywords


@dataclass(frozen=True, kw_only=True)
class RunConfig:
    """Settings that the runs of all algorithms have.

    Raises:
        ValueError: A setting is invalid. The message names it.
    """

    MAY_BE_ZERO: ClassVar[tuple[str, ...]] = ("seed",)
    """Names of the number settings that may be 0. All others must be above 0."""

    scenario: str
    """Name of the scenario, or code, see `registry.find_scenario`."""
    seed: int = 0
    """Seed of the run, 0 or more."""
    backend: str = DEFAULT_BACKEND
    """Name of the backend."""
    profile: str = "ideal"
    """Name or file of the profile of sensing and actuation."""
    observe: str = "velocity"
    """Observation type, see `observable.OBSERVE`."""
    options: dict[str, Any] = field(default_factory=dict)
    """Options of the scenario, by name."""
    drivers: dict[str, str] = field(default_factory=dict)
    """Drivers of seats that are not learned, by agent."""
    physics: dict[str, Any] = field(default_factory=dict)
    """Physics parameters by name: numbers, or ranges that are sampled for each
    episode."""
    control_dt: float = 0.05
    """Time between two actions, s, above 0."""
    total_steps: int
    """Number of training steps, summed over all worlds, above 0. Offline algorithms
    count gradient steps."""
    batch_size: int
    """Number of steps in a minibatch, above 0."""
    learning_rate: float
    """Initial learning rate, above 0."""
    gamma: float
    """Discount per control step, above 0 and at most 1."""
    hidden: list[int]
    """Widths of the hidden layers, at least one, each above 0. Networks share no
    layers."""
    evaluations: int
    """Number of evaluations during training, above 0."""
    eval_episodes: int
    """Number of episodes of each evaluation, or of games against each opponent, above
    0."""
    torch_threads: int = 1
    """Number of threads of torch, above 0."""
    device: str = "cpu"
    """Device of torch that learns: "cpu", "cuda", "cuda:NUMBER", or "auto" for a GPU if
    there is one. Evaluations are on the CPU, and worlds, too, except with the engine
    "device"."""

    def __post_init__(self) -> None:
        check_fields(self)
        for f in fields(self):
            value = getattr(self, f.name)
            positive = f.name not in self.MAY_BE_ZERO
            if f.type in ("int", "float") and positive and value <= 0:
                raise ValueError(f"{f.name}: {value} must be above 0")
        if self.seed < 0:
            raise ValueError(f"seed: {self.seed} must be 0 or more")
        if not self.hidden or any(w < 1 for w in self.hidden):
            raise ValueError(
                f"hidden: {self.hidden} must be one or more widths above 0"
            )
        if self.gamma > 1.0:
            raise ValueError(f"gamma: {self.gamma} must be in 0 .. 1")

    @property
    def keywords(self) -> Keywords:
        """Keywords of the environments of evaluations."""
        return {
            "backend": self.backend,
            "profile": self.profile,
            "observe": self.observe,
            "options": self.options,
            "drivers": self.drivers,
            "physics": self.physics,
            "control_dt": self.control_dt,
        }

    def card(self, labels: Sequence[str]) -> dict[str, Any]:
        """Return the card of a policy of this run, which describes its environment.

        Args:
            labels: Names of the elements of the observations.
        """
        return {
            "run_format": RUN_FORMAT,
            **trained_in(vars(self)),
            "observe": self.observe,
            "labels": list(labels),
        }

    def to_toml(self) -> str:
        """Return the configuration as TOML, which `settings.load_config` reads."""
        lines, tables = [f"format = {RUN_FORMAT}"], []
        for name, value in asdict(self).items():
            if isinstance(value, dict):
                tables.append(f"\n[{name}]")
                tables += [f"{k} = {_toml(v)}" for k, v in value.items()]
            else:
                lines.append(f"{name} = {_toml(value)}")
        return "\n".join([*lines, *tables]) + "\n"


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return str(value)
