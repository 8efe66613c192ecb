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
from marl_airhockey.plugins import load_code, load_plugin, names_code, plugins
from marl_airhockey.toolkit.players import driver_of
from marl_airhockey.toolkit.policies import ZOO

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


def _maker(kind: str, folder: str, group: str, name: str) -> Callable[..., object]:
    """Return what makes the scenario or driver of a name, ours or a plugin's."""
    own, others = _names(folder), plugins(group)
    if name in own or name not in others:
        module = _load(kind, folder, name, sorted({*own, *others}))
        return cast(Callable[..., object], module.make)
    return cast(Callable[..., object], load_plugin(others[name]))


def scenario_names() -> list[str]:
    """Return the names of all scenarios of ours: the files of ``scenarios/``."""
    return _names("scenarios")


def plugin_names(kind: str) -> list[str]:
    """Return the names that installed packages add: "scenarios" or "drivers"."""
    return sorted(plugins(kind))


def gymnasium_id(name: str) -> str:
    """Return the gymnasium id of a scenario, its version included."""
    module = _load("scenario", "scenarios", name, scenario_names())
    camel = "".join(word.capitalize() for word in name.split("_"))
    version = cast(type[Scenario], module.make).version
    return f"marl_airhockey/{camel}-v{version}"


def agent_names() -> list[str]:
    """Return the names of all drivers: the files of ``agents/``."""
    return _names("agents")


def plain_agent_names() -> list[str]:
    """Return the names of drivers that need no option: no file, no device."""
    makers = {n: _maker("driver", "agents", "drivers", n) for n in agent_names()}
    return [
        name
        for name, make in makers.items()
        if all(
            p.default is not p.empty
            for p in inspect.signature(make).parameters.values()
        )
    ]


def backend_names() -> list[str]:
    """Return the names of all backends: the folders of ``backends/``."""
    return _names("backends")


def make_scenario(name: str, **options: Any) -> Scenario:
    """Build the scenario of ``scenarios/<name>.py``, or that of an installed package.

    No code runs that a text names: see `find_scenario`.

    Raises:
        ValueError: an unknown name or option, or an option that makes no sense.
    """
    make = _maker("scenario", "scenarios", "scenarios", name)
    return _scenario(name, make, options)


def find_scenario(given: str | Scenario | type[Scenario], **options: Any) -> Scenario:
    """Build the scenario that somebody asks for.

    Args:
        given: a name; code, ``my_task.py`` or ``package.module:Task``; a class; or a
            scenario, which is returned as it is.
        **options: fields of the scenario.

    Raises:
        ValueError: an unknown name or option, or code that makes no scenario.
    """
    if isinstance(given, Scenario):
        if options:
            names = sorted(options)
            raise ValueError(f"options {names}: give them to the scenario object")
        return given
    if isinstance(given, str):
        if not names_code(given):
            return make_scenario(given, **options)
        return _scenario(given, load_code(given, Scenario), options)
    return _scenario(getattr(given, "__name__", repr(given)), given, options)


def _scenario(name: str, make: Any, options: Mapping[str, Any]) -> Scenario:
    if isinstance(make, Scenario):
        return find_scenario(make, **options)
    if not (isinstance(make, type) and issubclass(make, Scenario)):
        raise ValueError(
            f"{name}: {make!r} is no scenario; give a class below Scenario"
        )
    known = [f.name for f in dataclasses.fields(make)]
    return cast(Scenario, _build(f"option of {name}", make, options, known))


def zoo_names() -> list[str]:
    """Return the names of the trained policies that come with the library."""
    return sorted(f"zoo/{path.stem}" for path in ZOO.glob("*.npz"))


def make_agent(player: object, **options: Any) -> Driver:
    """Build the driver that somebody asks for.

    Args:
        player: the name of a file of ``agents/``, with options behind a colon or not
            (``allround:strength=fair,depth=0.05``); of a trained policy that comes with
            the library (``zoo/duel``); of an installed package's driver; the path of a
            policy's file or run folder; code, ``my_driver.py`` or
            ``package.module:Class``, with options or not; or an object, see
            `toolkit.players.driver_of`.
        **options: besides those in the name.

    Raises:
        ValueError: an unknown name or option, or one that makes no sense.
    """
    if not isinstance(player, (str, Path)):
        return _driver(type(player).__name__, player, options)
    text, path = str(player), Path(player)
    if isinstance(player, Path):  # A file, whatever its name looks like.
        return _driver(
            text,
            _maker("driver", "agents", "drivers", "policy"),
            {**options, "path": path},
        )
    short, _, given = text.partition(":")
    if short in {*agent_names(), *plugins("drivers")} or short.startswith("zoo/"):
        options = _options(given) | options
        if short.startswith("zoo/"):
            if short not in zoo_names():
                raise ValueError(unknown_name("policy of the zoo", short, zoo_names()))
            if "path" in options:
                raise ValueError(f"{text}: the path of a policy of the zoo is known")
            short, options["path"] = "policy", ZOO / f"{short[4:]}.npz"
        make = _maker("driver", "agents", "drivers", short)
        return _driver(short, make, options)
    code, given = _split(text)
    if names_code(code):
        options = _options(given) | options
        return _driver(code, load_code(code, Driver), options)
    if path.exists() or path.suffix in (".zip", ".onnx", ".npz"):
        return make_agent(path, **options)
    names = [*agent_names(), *plugin_names("drivers")]
    raise ValueError(
        unknown_name("driver", text, names)
        + "; or a policy's path, my_driver.py or package.module:Class"
    )


def _driver(name: str, player: Any, options: Mapping[str, Any]) -> Driver:
    """Return a driver from what makes one, or from a player of any kind."""
    makes = isinstance(player, type) and issubclass(player, Driver)
    if makes or (inspect.isfunction(player) and player.__name__ == "make"):
        parameters = inspect.signature(player).parameters
        for option, value in options.items():
            numeric = option in parameters and parameters[option].annotation == "float"
            if numeric and not isinstance(value, (int, float)):
                raise ValueError(
                    f"option {option!r} of {name}: expected a number, got {value!r}"
                )
        player = _build(f"option of {name}", player, options, list(parameters))
    elif options:
        raise ValueError(f"options {sorted(options)}: {name} takes none")
    return driver_of(player)


def _split(text: str) -> tuple[str, str]:
    """Return the name of a player without its options, and the options."""
    head, _, tail = text.rpartition(":")
    return (head, tail) if "=" in tail else (text, "")


def runs_code(text: str) -> bool:
    """Return True if `make_agent` or `find_scenario` would run code for a text."""
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
    if isinstance(make, type) and inspect.isabstract(make):
        names = make.__abstractmethods__  # type: ignore[attr-defined]
        missing = ", ".join(sorted(names))
        raise ValueError(f"{make.__name__} lacks {missing}")
    try:
        inspect.signature(make).bind(**options)
    except TypeError as error:
        raise ValueError(f"{what}: {error}") from error
    return make(**options)
