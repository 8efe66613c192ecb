"""Scenarios and drivers of users: files, modules and installed packages.

A text that names code (``my_task.py``, ``my_task.py:Task`` or ``package.module:Task``)
runs this code. These functions do not search files for such texts.
"""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

author_files: set[str] = set()
"""Files of users that were loaded, to separate their code from this library."""


def plugins(kind: str) -> dict[str, EntryPoint]:
    """Return entry points of installed packages by name, without loading them.

    Args:
        kind: End of the group ``marl_airhockey.<kind>``, "scenarios" or "drivers".
    """
    return {e.name: e for e in entry_points(group=f"marl_airhockey.{kind}")}


def load_plugin(entry: EntryPoint) -> Any:
    """Return the class or function of an entry point.

    Raises:
        ValueError: The entry point cannot be imported.
    """
    try:
        loaded = entry.load()
    except (Exception, SystemExit) as error:
        raise ValueError(_failed(f"{entry.name} ({entry.value})", error)) from error
    _note(sys.modules[entry.module])
    return loaded


def names_code(text: str) -> bool:
    """Return True if a text names a Python file or a module that exists."""
    place, colon, name = text.partition(":")
    if place.endswith(".py"):
        return not colon or name.isidentifier()
    parts = place.split(".")
    if not all(part.isidentifier() for part in (*parts, name)):
        return False
    with _here():
        return importlib.util.find_spec(parts[0]) is not None


def load_code(text: str, base: type) -> Any:
    """Return the class, function or object that a text names.

    Args:
        text: Text ``FILE.py``, ``FILE.py:NAME`` or ``package.module:NAME``. Without a
            name, the result is ``make`` of the file, or its only subclass of ``base``.
        base: Base class of the classes in a file.

    Raises:
        ValueError: The file, module or name does not exist, or the import fails.
    """
    place, _, name = text.partition(":")
    module = _file(Path(place)) if place.endswith(".py") else _module(place)
    _note(module)
    if name:
        if not hasattr(module, name):
            raise ValueError(f"{place}: it has no {name!r}")
        return getattr(module, name)
    if hasattr(module, "make"):
        return module.make
    found = [
        value
        for value in vars(module).values()
        if inspect.isclass(value)
        and issubclass(value, base)
        and value.__module__ == module.__name__
    ]
    if len(found) != 1:
        names = ", ".join(value.__name__ for value in found) or "none"
        raise ValueError(
            f"{place}: expected one subclass of {base.__name__}, found {names}; name "
            f"one with {place}:NAME"
        )
    return found[0]


def _note(module: ModuleType) -> None:
    if module.__file__ is not None:
        author_files.add(module.__file__)


def _file(path: Path) -> ModuleType:
    path = path.expanduser().resolve()
    if not path.is_file():
        raise ValueError(f"{path}: there is no such file")
    loaded = sys.modules.get(path.stem)
    if loaded is not None:
        if getattr(loaded, "__file__", None) == str(path):
            return loaded
        raise ValueError(
            f"{path}: a module named {path.stem!r} is already loaded; rename the file"
        )
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # Dataclasses and pickles find their module by its name.
    sys.modules[path.stem] = module
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        del sys.modules[path.stem]
        raise ValueError(_failed(str(path), error)) from error
    return module


def _module(name: str) -> ModuleType:
    try:
        with _here():
            return importlib.import_module(name)
    except (Exception, SystemExit) as error:
        raise ValueError(_failed(name, error)) from error


@contextmanager
def _here() -> Iterator[None]:
    """Also find modules of the current folder, as `python -m` does."""
    here = str(Path.cwd())
    sys.path.insert(0, here)
    try:
        yield
    finally:
        sys.path.remove(here)


def _failed(what: str, error: BaseException) -> str:
    return f"{what}: it cannot be imported: {type(error).__name__}: {error}"
