"""Find a scenario, a driver or a backend by its name."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any, cast

from marl_airhockey.discovery import names_in
from marl_airhockey.plugins import load_code, load_plugin, names_code, plugins
from marl_airhockey.policies.callables import driver_of
from marl_airhockey.policies.load import ZOO, load_policy
from marl_airhockey.sim.backends.find import simulated_backend, simulated_names
from marl_airhockey.sim.contracts.backend import Backend, LiveBackend
from marl_airhockey.sim.contracts.driver import Driver
from marl_airhockey.sim.contracts.scenario import GoalScenario, Scenario
from marl_airhockey.sim.core.errors import unknown_name

DEFAULT_BACKEND = "numba"
"""Name of the default backend."""
REAL = "real"
"""Name of the backend of a real table."""


def _load(kind: str, folder: str, name: str, names: list[str]) -> ModuleType:
    if name not in names:
        raise ValueError(unknown_name(kind, name, names))
    return importlib.import_module(f"marl_airhockey.{folder}.{name}")


def _maker(kind: str, folder: str, group: str, name: str) -> Callable[..., object]:
    """Return the class or function of a scenario or driver of ours or of a plugin."""
    own, others = names_in(folder), plugins(group)
    if name in own or name not in others:
        module = _load(kind, folder, name, sorted({*own, *others}))
        return cast(Callable[..., object], module.make)
    return cast(Callable[..., object], load_plugin(others[name]))


def scenario_names() -> list[str]:
    """Return the names of all scenarios in ``scenarios/``."""
    return names_in("scenarios")


def plugin_names(kind: str) -> list[str]:
    """Return the names of "scenarios" or "drivers" that installed packages add."""
    return sorted(plugins(kind))


def driver_names() -> list[str]:
    """Return the names of all drivers in ``drivers/``."""
    return names_in("drivers")


def independent_driver_names() -> list[str]:
    """Return the names of the drivers that need no device and no person."""
    kinds = {name: driver_class(name) for name in driver_names()}
    return [
        name
        for name, kind in kinds.items()
        if not (kind.needs_device or kind.needs_person)
    ]


def driver_class(name: str) -> type[Driver]:
    """Return the class of a driver in ``drivers/``.

    Raises:
        ValueError: The name is unknown.
    """
    return cast(type[Driver], _load("driver", "drivers", name, driver_names()).make)


def backend_names() -> list[str]:
    """Return the names of all backends: the simulated ones and "real"."""
    return sorted([*simulated_names(), REAL])


def make_scenario(name: str, **options: Any) -> Scenario:
    """Create a scenario of this library or of an installed package.

    In contrast to `find_scenario`, a name never runs code of a file or module.

    Args:
        name: Name of the scenario.
        **options: Fields of the scenario by name.

    Raises:
        ValueError: The name or an option is unknown, or a value is not valid.
    """
    make = _maker("scenario", "scenarios", "scenarios", name)
    return _scenario(name, make, options)


def find_scenario(given: str | Scenario | type[Scenario], **options: Any) -> Scenario:
    """Create a scenario from a name, code, a class or an object.

    Args:
        given: Name of a scenario; code, ``my_task.py`` or ``package.module:Task``; a
            class; or a scenario object, which is returned unchanged.
        **options: Fields of the scenario by name.

    Raises:
        ValueError: A name or an option is unknown, or the code defines no scenario.
    """
    if not isinstance(given, str):
        return _scenario(getattr(given, "__name__", repr(given)), given, options)
    if names_code(given):
        return _scenario(given, load_code(given, Scenario), options)
    return make_scenario(given, **options)


def has_goals(given: str | Scenario | type[Scenario]) -> bool:
    """Return True if a scenario has goals; `find_scenario` explains the argument."""
    return isinstance(find_scenario(given), GoalScenario)


def _scenario(name: str, make: Any, options: Mapping[str, Any]) -> Scenario:
    """Return a scenario from its class, or the given object if it has no options."""
    if isinstance(make, Scenario):
        if options:
            names = sorted(options)
            raise ValueError(f"options {names}: set them in the scenario object")
        return make
    if not (isinstance(make, type) and issubclass(make, Scenario)):
        raise ValueError(
            f"{name}: {make!r} is not a scenario; expected a subclass of Scenario"
        )
    known = [f.name for f in dataclasses.fields(make)]
    return cast(Scenario, _build(f"option of {name}", make, options, known))


def zoo_names() -> list[str]:
    """Return the names of the trained policies of this library."""
    return sorted(f"zoo/{path.stem}" for path in ZOO.glob("*.npz"))


def make_driver(player: object, **options: Any) -> Driver:
    """Create a driver from a name, a path, code or an object.

    Args:
        player: One of the following. Options may follow a name and code after a colon,
            as in ``allround:strength=fair,depth=0.05``.

            - Name of a driver of this library or of an installed package.
            - Name of a trained policy of this library, as in ``zoo/duel``.
            - Path of a policy's file or of a run folder.
            - Code, ``my_driver.py`` or ``package.module:Class``.
            - Object that `policies.callables.driver_of` accepts.
        **options: Options in addition to the options in the name.

    Raises:
        ValueError: A name or an option is unknown, or a value is not valid.
    """
    if isinstance(player, (str, Path)):
        name, make, more = _named(player)
        return _driver(name, make, {**more, **options})
    return _driver(type(player).__name__, player, options)


def _named(given: str | Path) -> tuple[str, Any, dict[str, Any]]:
    """Return the name of a driver, its class or function, and its options."""
    text, path = str(given), Path(given)
    if isinstance(given, Path):  # Always a file, with any name.
        return text, partial(_load_file, path), {}
    short, _, tail = text.partition(":")
    if short.startswith("zoo/"):
        if short not in zoo_names():
            raise ValueError(unknown_name("policy of the zoo", short, zoo_names()))
        return short, partial(_load_file, ZOO / f"{short[4:]}.npz"), _options(tail)
    if short in {*driver_names(), *plugins("drivers")}:
        return short, _maker("driver", "drivers", "drivers", short), _options(tail)
    code, tail = _split(text)
    if names_code(code):
        return code, load_code(code, Driver), _options(tail)
    if path.exists() or path.suffix in (".zip", ".onnx", ".npz"):
        return text, partial(_load_file, path), {}
    if "/" in text:
        raise ValueError(f"{text}: there is no such run and no such policy")
    names = [*driver_names(), *plugin_names("drivers")]
    raise ValueError(
        unknown_name("driver", text, names)
        + "; a policy's path, my_driver.py or package.module:Class is possible, too"
    )


def _load_file(path: Path, deterministic: bool = True) -> Driver:
    """Load a policy. Names may come from files, so its code is never trusted."""
    return load_policy(path, bool(deterministic))


def _driver(name: str, given: Any, options: Mapping[str, Any]) -> Driver:
    """Return a driver from a class, a function that returns one, or an object."""
    own_class = isinstance(given, type) and issubclass(given, Driver)
    named_make = inspect.isfunction(given) and given.__name__ == "make"
    if own_class or named_make or isinstance(given, partial):
        parameters = inspect.signature(given).parameters
        options = {
            option: make_driver(value)
            if option in parameters and "Driver" in str(parameters[option].annotation)
            else value
            for option, value in options.items()
        }
        for option, value in options.items():
            numeric = option in parameters and parameters[option].annotation == "float"
            if numeric and not isinstance(value, (int, float)):
                raise ValueError(
                    f"option {option!r} of {name}: expected a number, got {value!r}"
                )
        given = _build(f"option of {name}", given, options, list(parameters))
    elif options:
        raise ValueError(f"options {sorted(options)}: {name} has no options")
    return driver_of(given)


def _split(text: str) -> tuple[str, str]:
    """Return the name of a driver without its options, and the options."""
    head, _, tail = text.rpartition(":")
    return (head, tail) if "=" in tail else (text, "")


def runs_code(text: str) -> bool:
    """Return True if `make_driver` or `find_scenario` would run code for a text."""
    return names_code(text) or names_code(_split(text)[0])


def _options(text: str) -> dict[str, str | float]:
    return dict(_option(part) for part in text.split(",") if part)


def _option(part: str) -> tuple[str, str | float]:
    name, equals, value = part.partition("=")
    if not equals:
        raise ValueError(f"option {part!r}: expected NAME=VALUE")
    try:
        return name, float(value)
    except ValueError:
        return name, value


def find_backend(name: str) -> type[Backend]:
    """Return the class of a backend.

    Raises:
        ValueError: The name is unknown.
        RuntimeError: The backend cannot run here. The message states what to do.
    """
    if name not in backend_names():
        raise ValueError(unknown_name("backend", name, backend_names()))
    if name == REAL:
        from marl_airhockey.hardware.table.backend import RealBackend

        backend: type[Backend] = RealBackend
    else:
        backend = simulated_backend(name)
    reason = backend.available()
    if reason:
        raise RuntimeError(f"backend {name!r}: {reason}")
    return backend


def is_live(backend: str) -> bool:
    """Return True if a name is that of a backend of a real table."""
    return issubclass(find_backend(backend), LiveBackend)


def _build(
    what: str,
    make: Callable[..., object],
    options: Mapping[str, Any],
    known: list[str],
) -> object:
    for option in options:
        if option not in known:
            raise ValueError(unknown_name(what, option, known))
    if isinstance(make, type) and inspect.isabstract(make):
        names = make.__abstractmethods__  # type: ignore[attr-defined]
        missing = ", ".join(sorted(names))
        raise ValueError(f"{make.__name__} lacks {missing}")
    try:
        inspect.signature(make).bind(**options)
    except TypeError as error:
        raise ValueError(f"{what}: {error}") from error
    return make(**options)
