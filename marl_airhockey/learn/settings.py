"""Settings of runs in files: reading and checks."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

from marl_airhockey.learn.run_config import RunConfig
from marl_airhockey.policies.runs import check_run_format
from marl_airhockey.policies.trust import is_trusted_code, require_trust
from marl_airhockey.registry import runs_code
from marl_airhockey.sim.core.checks import build
from marl_airhockey.sim.core.errors import unknown_name

C = TypeVar("C", bound=RunConfig)


def check_names(kind: type[RunConfig], settings: Mapping[str, Any]) -> None:
    """Check that a kind of configuration has the settings.

    Raises:
        ValueError: A setting is unknown. The message lists the known ones.
    """
    known = [f.name for f in fields(kind)]
    for name in settings:
        if name not in known:
            raise ValueError(unknown_name("setting", name, known))


def read_settings(path: Path) -> dict[str, Any]:
    """Return the settings in the ``config.toml`` of a run.

    Raises:
        ValueError: The file is not a configuration, the run has another format, or the
            configuration names Python code that is not trusted.
    """
    try:
        data = tomllib.loads(path.read_text())
    except (OSError, tomllib.TOMLDecodeError) as error:
        raise ValueError(f"{path} is not a training configuration: {error}") from error
    found = data.pop("format", 1)
    if "scenario" in data:
        check_run_format(path.parent, found)
    _refuse_code(path, data)
    return data


def load_config(kind: type[C], path: Path) -> C:
    """Read a configuration that `RunConfig.to_toml` wrote.

    Args:
        kind: Class of the configuration.
        path: Path of the ``config.toml`` of a run.

    Raises:
        ValueError: The file cannot be read, see `read_settings`, or it is the
            configuration of another algorithm.
    """
    data, names = read_settings(path), {f.name for f in fields(kind)}
    if "algo" in data and "algo" not in names:
        raise ValueError(f"{path.parent} is a run of {data['algo']}, not of PPO")
    try:
        return build(kind, data)
    except ValueError as error:
        raise ValueError(f"{path} is not a training configuration: {error}") from error


def _refuse_code(path: Path, data: Mapping[str, Any]) -> None:
    """Require trust before code is run that a configuration names.

    Raises:
        ValueError: The user does not trust the configuration, which may be from another
            person.
    """
    named = [data.get("scenario", ""), *dict(data.get("drivers", {})).values()]
    named += [*data.get("opponents", []), *data.get("eval_opponents", [])]
    found = [t for t in map(str, named) if runs_code(t) and not is_trusted_code(t)]
    if found:
        require_trust(path, code=f"the name of Python code, {found[0]}")
