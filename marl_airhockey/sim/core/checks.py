"""Checks of dataclasses: types, finite numbers and ranges of their fields.

A dataclass calls `check_fields` in ``__post_init__``. `build` creates a dataclass from
a JSON object. Both raise a ValueError that names the field, the given value and the
expected value.
"""

from __future__ import annotations

import math
import types
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from numbers import Integral, Real
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

from marl_airhockey.sim.core.errors import unknown_name

T = TypeVar("T")
Range = tuple[float, float]


def _hints(kind: type) -> dict[str, Any]:
    """Return the types of the fields that a constructor takes."""
    hints = get_type_hints(kind)
    return {f.name: hints[f.name] for f in fields(kind) if f.init}


def check_count(name: str, value: Any, why: str = "") -> int:
    """Return a count as a plain int.

    Args:
        name: Name of the counted quantity, for the message.
        value: Count to check.
        why: Reason for the rule, for the message.

    Raises:
        ValueError: The value is not a whole number of at least 1.
    """
    if isinstance(value, bool) or not isinstance(value, Integral) or value < 1:
        raise ValueError(f"{name}: {value!r} must be a whole number above 0{why}")
    return int(value)


def check_seed(seed: Any) -> int:
    """Return the seed of the first of several episodes as a plain int.

    Raises:
        ValueError: The seed is not a whole number of at least 0.
    """
    if isinstance(seed, bool) or not isinstance(seed, Integral) or seed < 0:
        raise ValueError(f"seed: {seed!r} must be a whole number of at least 0")
    return int(seed)


def check_fields(made: Any, **ranges: Range) -> None:
    """Check the fields of a dataclass.

    Args:
        made: Instance of the dataclass.
        ranges: Smallest and largest value of the numbers in a field, by field name.

    Raises:
        ValueError: A field has another type, or a number in it is not finite or is
            outside its range.
    """
    for name, hint in _hints(type(made)).items():
        _check(name, getattr(made, name), hint, ranges.get(name))


def _check(name: str, value: Any, hint: Any, bounds: Range | None) -> None:
    if hint is Any:
        return
    origin, inner = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        if value is None and type(None) in inner:
            return
        hint = next(kind for kind in inner if kind is not type(None))
        _check(name, value, hint, bounds)
    elif hint in (float, int):
        _check_number(name, value, hint, bounds)
    elif origin in (tuple, list):
        _check_sequence(name, value, origin, inner, bounds)
    elif origin is dict:
        _check_kind(name, value, dict)
        for key, part in value.items():
            _check(f"{name}.{key}", part, inner[1], bounds)
    else:
        _check_kind(name, value, hint)


def _check_kind(name: str, value: Any, kind: type) -> None:
    if not isinstance(value, kind):
        raise ValueError(f"{name}: {value!r}; expected a {kind.__name__}")


def _check_number(name: str, value: Any, hint: type, bounds: Range | None) -> None:
    kind, word = (Integral, "whole number") if hint is int else (Real, "number")
    low, high = bounds or (-math.inf, math.inf)
    fits = isinstance(value, kind) and not isinstance(value, bool)
    if fits and math.isfinite(value) and low <= value <= high:
        return
    between = f" from {low:g} to {high:g}" if bounds else ""
    raise ValueError(f"{name}: {value!r}; expected a finite {word}{between}")


def _check_sequence(
    name: str, value: Any, kind: type, inner: tuple[Any, ...], bounds: Range | None
) -> None:
    _check_kind(name, value, kind)
    open_end = kind is list or (len(inner) == 2 and inner[1] is Ellipsis)
    if not open_end and len(value) != len(inner):
        raise ValueError(f"{name}: {value!r}; expected {len(inner)} values")
    parts = [inner[0]] * len(value) if open_end else inner
    for k, (part, hint) in enumerate(zip(value, parts, strict=True)):
        _check(f"{name}[{k}]", part, hint, bounds)


def build(kind: type[T], given: Any, where: str = "") -> T:
    """Return a dataclass with the fields of a JSON object.

    Args:
        kind: Dataclass, whose fields may be dataclasses.
        given: JSON object in the form that `dataclasses.asdict` returns.
        where: Name of the object, for messages.

    Raises:
        ValueError: A field is unknown, missing or wrong.
    """
    if not isinstance(given, Mapping):
        raise ValueError(f"{where or kind.__name__}: {given!r}; expected an object")
    hints, prefix = _hints(kind), f"{where}." if where else ""
    for name in given:
        if name not in hints:
            place = f"{where}: " if where else ""
            raise ValueError(place + unknown_name("field", name, hints))
    for field in fields(kind):  # type: ignore[arg-type]
        has_default = (
            field.default is not MISSING or field.default_factory is not MISSING
        )
        if field.name in hints and field.name not in given and not has_default:
            raise ValueError(f"{prefix}{field.name}: it is missing")
    values = {
        name: _value(value, hints[name], prefix + name) for name, value in given.items()
    }
    try:
        return kind(**values)
    except ValueError as error:
        raise ValueError(f"{prefix}{error}") from None


def _value(given: Any, hint: Any, where: str) -> Any:
    """Convert a JSON value to its type: lists to tuples, objects to dataclasses."""
    inner = get_args(hint)
    if get_origin(hint) in (Union, types.UnionType):
        hint = next(kind for kind in inner if kind is not type(None))
        return None if given is None else _value(given, hint, where)
    if is_dataclass(hint) and not isinstance(given, hint):  # type: ignore[arg-type]
        return build(hint, given, where)  # type: ignore[arg-type]
    if get_origin(hint) is tuple and isinstance(given, list):
        parts = [inner[0]] * len(given) if inner[-1] is Ellipsis else [*inner]
        parts += [Any] * (len(given) - len(parts))
        return tuple(
            _value(v, part, where) for v, part in zip(given, parts, strict=False)
        )
    return given
