"""Find a scenario, an agent or a backend by the name of its file."""

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
"""Name of the backend that is used unless another is given"""
REAL = "real"
"""Name of the backend of a real table"""


def _load(kind: str, folder: str, name: str, names: list[str]) -> ModuleType:
    if name not in names:
        raise ValueError(unknown_name(kind, name, names))
    return importlib.import_module(f"marl_airhockey.{folder}.{name}")


def _maker(kind: str, folder: str, group: str, name: str) -> Callable[..., object]:
    """Return what makes the scenario or driver of a name, ours or a plugin's."""
    own, others = names_in(folder), plugins(group)
    if name in own or name not in others:
        module = _load(kind, folder, name, sorted({*own, *others}))
        return cast(Callable[..., object], module.make)
    return cast(Callable[..., object], load_plugin(others[name]))


def scenario_names() -> list[str]:
    """Return the names of all scenarios of ours: the files of ``scenarios/``."""
    return names_in("scenarios")


def plugin_names(kind: str) -> list[str]:
    """Return the names that installed packages add: "scenarios" or "drivers"."""
    return sorted(plugins(kind))


def driver_names() -> list[str]:
    """Return the names of all drivers: the files of ``drivers/``."""
    return names_in("drivers")


def independent_driver_names() -> list[str]:
    """Return the names of drivers that play by themselves: no device, no person."""
    kinds = {name: driver_class(name) for name in driver_names()}
    return [
        name
        for name, kind in kinds.items()
        if not (kind.needs_device or kind.needs_person)
    ]


def driver_class(name: str) -> type[Driver]:
    """Return the class of a driver in ``drivers/``.

    Raises:
        ValueError: An unknown name.
    """
    return cast(type[Driver], _load("driver", "drivers", name, driver_names()).make)


def backend_names() -> list[str]:
    """Return the names of all backends, the simulated ones and "real"."""
    return sorted([*simulated_names(), REAL])


def make_scenario(name: str, **options: Any) -> Scenario:
    """Build the scenario of ``scenarios/<name>.py``, or that of an installed package.

    No code runs that a text names: see `find_scenario`.

    Raises:
        ValueError: an unknown name or option, or an option that makes no sense.
    """
    make = _maker("scenario", "scenarios", "scenarios", name)
    return _scenario(name, make, options)


def find_scenario(given: str | Scenario | type[Scenario], **options: Any) -> Scenario:
    """Build a scenario from its name, code, a class or an object.

    Args:
        given: Name; code, ``my_task.py`` or ``package.module:Task``; a class; or a
            scenario, which is returned as it is.
        **options: Fields of the scenario.

    Raises:
        ValueError: An unknown name or option, or code that makes no scenario.
    """
    if not isinstance(given, str):
        return _scenario(getattr(given, "__name__", repr(given)), given, options)
    if names_code(given):
        return _scenario(given, load_code(given, Scenario), options)
    return make_scenario(given, **options)


def has_goals(given: str | Scenario | type[Scenario]) -> bool:
    """Return whether a scenario has goals, see `find_scenario`."""
    return isinstance(find_scenario(given), GoalScenario)


def _scenario(name: str, make: Any, options: Mapping[str, Any]) -> Scenario:
    """Return a scenario from its class, or the object itself, without options."""
    if isinstance(make, Scenario):
        if options:
            names = sorted(options)
            raise ValueError(f"options {names}: give them to the scenario object")
        return make
    if not (isinstance(make, type) and issubclass(make, Scenario)):
        raise ValueError(
            f"{name}: {make!r} is no scenario; give a class below Scenario"
        )
    known = [f.name for f in dataclasses.fields(make)]
    return cast(Scenario, _build(f"option of {name}", make, options, known))


def zoo_names() -> list[str]:
    """Return the names of the trained policies that come with the library."""
    return sorted(f"zoo/{path.stem}" for path in ZOO.glob("*.npz"))


def make_driver(player: object, **options: Any) -> Driver:
    """Build a driver from its name, a path, code or an object.

    Args:
        player: Name of a file of ``drivers/``, with or without options after a colon
            (``allround:strength=fair,depth=0.05``); of a trained policy that comes with
            the library (``zoo/duel``); of an installed package's driver; path of a
            policy's file or run folder; code, ``my_driver.py`` or
            ``package.module:Class``, with or without options; or an object, see
            `policies.callables.driver_of`.
        **options: Options in addition to those in the name.

    Raises:
        ValueError: An unknown name or option, or one that makes no sense.
    """
    if isinstance(player, (str, Path)):
        name, make, more = _named(player)
        return _driver(name, make, {**more, **options})
    return _driver(type(player).__name__, player, options)


def _named(given: str | Path) -> tuple[str, Any, dict[str, Any]]:
    """Return the name of a driver, what makes it, and the options in its name."""
    text, path = str(given), Path(given)
    if isinstance(given, Path):  # A file, whatever its name looks like.
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
        + "; or a policy's path, my_driver.py or package.module:Class"
    )


def _load_file(path: Path, deterministic: bool = True) -> Driver:
    """Load a policy. Trust in its code is no option: names come from files, too."""
    return load_policy(path, bool(deterministic))


def _driver(name: str, given: Any, options: Mapping[str, Any]) -> Driver:
    """Return a driver from a function or class that makes one, or from an object."""
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
        raise ValueError(f"options {sorted(options)}: {name} takes none")
    return driver_of(given)


def _split(text: str) -> tuple[str, str]:
    """Return the name of a player without its options, and the options."""
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
        ValueError: An unknown name.
        RuntimeError: It cannot run here; the message says the fix.
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
    """Return True for the name of a backend of a real table."""
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
