"""Find a scenario, an agent or a backend by the name of its file."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import pkgutil
from collections.abc import Callable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any, cast

from marl_airhockey.contracts.backend import Backend
from marl_airhockey.contracts.driver import Driver
from marl_airhockey.contracts.scenario import Scenario
from marl_airhockey.core.errors import unknown_name

ZOO = Path(__file__).parent / "zoo"
DEFAULT_BACKEND = "numba"
"""Name of the backend that is used unless another is asked for."""


def _names(folder: str) -> list[str]:
    package = importlib.import_module(f"marl_airhockey.{folder}")
    found = pkgutil.iter_modules(package.__path__)
    return sorted(m.name for m in found if not m.name.startswith("_"))


def _load(kind: str, folder: str, name: str, names: list[str]) -> ModuleType:
    if name not in names:
        raise ValueError(unknown_name(kind, name, names))
    return importlib.import_module(f"marl_airhockey.{folder}.{name}")


def scenario_names() -> list[str]:
    """Return the names of all scenarios: the files of ``scenarios/``."""
    return _names("scenarios")


def gymnasium_id(name: str) -> str:
    """Return the gymnasium id of a scenario, its version included."""
    module = _load("scenario", "scenarios", name, scenario_names())
    camel = "".join(word.capitalize() for word in name.split("_"))
    version = cast(type[Scenario], module.make).version
    return f"marl_airhockey/{camel}-v{version}"


def agent_names() -> list[str]:
    """Return the names of all drivers: the files of ``agents/``."""
    return _names("agents")


def backend_names() -> list[str]:
    """Return the names of all backends: the folders of ``backends/``."""
    return _names("backends")


def make_scenario(name: str, **options: Any) -> Scenario:
    """Build the scenario of ``scenarios/<name>.py``.

    Raises:
        ValueError: an unknown name or option, or an option that makes no sense.
    """
    module = _load("scenario", "scenarios", name, scenario_names())
    known = [f.name for f in dataclasses.fields(module.make)]
    return cast(Scenario, _build(f"option of {name}", module.make, options, known))


def zoo_names() -> list[str]:
    """Return the names of the trained policies that come with the library."""
    return sorted(f"zoo/{path.stem}" for path in ZOO.glob("*.npz"))


def make_agent(name: str | Path, **options: Any) -> Driver:
    """Build the driver that a text names.

    Args:
        name: of a file of ``agents/``, with options behind a colon or not
            (``allround:strength=fair,depth=0.05``); of a trained policy that comes with
            the library (``zoo/duel``); or the path of a policy's file or run folder.
        **options: besides those in the name.

    Raises:
        ValueError: an unknown name or option, or one that makes no sense.
    """
    path, (short, _, given) = Path(name), str(name).partition(":")
    if short in agent_names() or short.startswith("zoo/"):
        options = dict(_option(part) for part in given.split(",") if part) | options
        if short.startswith("zoo/"):
            if short not in zoo_names():
                raise ValueError(unknown_name("policy of the zoo", short, zoo_names()))
            short, options["path"] = "policy", ZOO / f"{short[4:]}.npz"
        module = _load("driver", "agents", short, agent_names())
        known = list(inspect.signature(module.make).parameters)
        return cast(Driver, _build(f"option of {short}", module.make, options, known))
    if path.exists() or path.suffix in (".zip", ".onnx", ".npz"):
        return make_agent("policy", path=path, **options)
    raise ValueError(
        unknown_name("driver", name, agent_names()) + "; or the path of a policy"
    )


def _option(part: str) -> tuple[str, str | float]:
    name, equals, value = part.partition("=")
    if not equals:
        raise ValueError(f"option {part!r}: expected NAME=VALUE")
    try:
        return name, float(value)
    except ValueError:
        return name, value


def find_backend(name: str) -> type[Backend]:
    """Return the backend class of ``backends/<name>/``.

    Raises:
        ValueError: an unknown name.
        RuntimeError: it cannot run here; the message says the fix.
    """
    module = _load("backend", "backends", name, backend_names())
    backend = cast(type[Backend], module.make)
    reason = backend.available()
    if reason:
        raise RuntimeError(f"backend {name!r}: {reason}")
    return backend


def _build(
    what: str,
    make: Callable[..., object],
    options: Mapping[str, Any],
    known: list[str],
) -> object:
    for option in options:
        if option not in known:
            raise ValueError(unknown_name(what, option, known))
    try:
        inspect.signature(make).bind(**options)
    except TypeError as error:
        raise ValueError(f"{what}: {error}") from error
    return make(**options)
