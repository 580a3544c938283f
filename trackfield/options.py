"""Options of a class that a scenario names: its fields, checked by their annotations."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, is_dataclass
from difflib import get_close_matches
from functools import partial
from types import NoneType, UnionType
from typing import Annotated, Any, Final, Literal, Union, get_args, get_origin

from trackfield.errors import ScenarioError, together
from trackfield.words import quoted

_WORDS: Final = {int: "a whole number", float: "a number", bool: "true or false", str: "a text"}
_LONGEST: Final = 100
"""No option has a longer name."""


@dataclass(frozen=True, slots=True)
class Within:
    """The range of an option, both ends included: ``n: Annotated[int, Within(1, 1000)] = 200``."""

    least: float
    most: float


def made(maker: Callable[..., Any], options: Mapping[str, Any], key: str) -> Any:
    """``maker(**options)``, for options that exist and fit their annotated types.

    Raises ``ScenarioError`` with ``key.option`` otherwise, with the nearest name and all names, or the expected type.
    A ``ValueError`` of the class itself, as from ``__post_init__``, is passed on under ``key``.
    """
    known = _parameters(maker)
    together(partial(_check, f"{key}.{name}", name, value, known) for name, value in options.items())
    try:
        return maker(**options)
    except (TypeError, ValueError) as error:
        raise ScenarioError(str(error), key=key) from error


def _check(key: str, name: str, value: object, known: Mapping[str, Any]) -> None:
    """Raise ``ScenarioError`` unless this is an option, and the value fits it."""
    if name not in known:
        near = get_close_matches(name[:_LONGEST], known, n=1)
        hint = f"; did you mean {near[0]}?" if near else ""
        expected = f"one of {', '.join(known)}" if known else "none: it has no options"
        raise ScenarioError(f"unknown option{hint}", key=key, expected=expected)
    if not _fits(value, known[name]):
        raise ScenarioError(f"is {quoted(value)}", key=key, expected=_words(known[name]))


def _parameters(maker: Callable[..., Any]) -> dict[str, Any]:
    """The options of a maker and their annotations: of a dataclass, as the class has them that declares each."""
    declared = _declared(maker) if is_dataclass(maker) else {}
    try:
        parameters = inspect.signature(maker, eval_str=True).parameters
    except NameError:  # an annotation that cannot be resolved, as in a class within a function
        parameters = inspect.signature(maker).parameters
    taken = [p for p in parameters.values() if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)]
    return {p.name: declared.get(p.name, p.annotation) for p in taken}


def _declared(maker: Any) -> dict[str, Any]:
    """The annotations of a class and of those that it inherits from, whose names are looked up where each stands."""
    found: dict[str, Any] = {}
    for one in reversed(maker.__mro__):
        with suppress(NameError):
            found |= inspect.get_annotations(one, eval_str=True)
    return found


def _fits(value: object, hint: Any) -> bool:
    """Whether a value is of an annotated type; any value passes for types that scenarios cannot express."""
    if get_origin(hint) is Annotated:
        base, *about = get_args(hint)
        return _fits(value, base) and all(one.least <= value <= one.most for one in _ranges(about))
    if get_origin(hint) is Literal:
        return any(value == one and type(value) is type(one) for one in get_args(hint))
    if get_origin(hint) in (Union, UnionType):
        return any(_fits(value, one) for one in get_args(hint) if one is not NoneType)
    if get_origin(hint) is Mapping:
        return isinstance(value, Mapping) and all(_fits(one, get_args(hint)[1]) for one in value.values())
    if hint is float:
        return type(value) in (int, float) and math.isfinite(value)  # type: ignore[arg-type]
    return type(value) is hint if hint in _WORDS else True


def _ranges(about: Sequence[object]) -> list[Any]:
    """The ranges in the annotations of a type."""
    return [one for one in about if isinstance(one, Within)]


def _words(hint: Any) -> str:
    if get_origin(hint) is Annotated:
        base, *about = get_args(hint)
        return " ".join([_words(base), *(f"from {one.least:.9g} to {one.most:.9g}" for one in _ranges(about))])
    if get_origin(hint) is Literal:
        return f"one of {', '.join(map(str, get_args(hint)))}"
    if get_origin(hint) in (Union, UnionType):
        return " or ".join(_words(one) for one in get_args(hint) if one is not NoneType)
    if get_origin(hint) is Mapping:
        return f"a table by sensor, each {_words(get_args(hint)[1])}"
    return _WORDS[hint]
