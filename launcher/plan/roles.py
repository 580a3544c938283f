"""Where the roles of a field are made: installed ones, and those of a user's architecture."""

from __future__ import annotations

from collections.abc import Mapping, Set
from functools import cache
from importlib.metadata import entry_points
from typing import Any, Final

import msgpack

from launcher.plan.architectures import Process
from trackfield.drivers.spec import role_factory
from trackfield.errors import ScenarioError
from trackfield.plugins import brought
from trackfield.words import quoted

METHODS: Final = ("kinds", "begin", "handle")
"""What every role has."""


@cache
def installed(role: str) -> str:
    """Where an installed package makes roles of this name. Raises ``ScenarioError`` if none does."""
    for entry in entry_points(group="trackfield.roles", name=role):
        return entry.value
    expected = "a Process with a factory, or an entry point in trackfield.roles"
    raise ScenarioError(f"no installed package offers the role {role!r}", expected=expected)


class Roles:
    """Finds what makes each role of a run, and checks that it does; ``key`` names the architecture in errors.

    Of an installed role one is made for each set of arguments, of a user's own each one.
    """

    def __init__(self, key: str) -> None:
        self._key = key
        self._good: set[tuple[str, frozenset[str]]] = set()

    def factory(self, process: Process, config: Mapping[str, Any]) -> str:
        """``module:attribute`` of what makes the role of a process with these arguments. Raises ``ScenarioError``."""
        given = process.factory
        place = installed(process.role) if not given else given if isinstance(given, str) else self._place(process)
        arguments = place, frozenset(config)
        if given or arguments not in self._good:
            self._try(process, place, config)
            self._good.add(arguments)
        return place

    def _place(self, process: Process) -> str:
        if not callable(process.factory):
            raise self._error(process, "factory", f"is {process.factory!r}", "a class, or module:attribute")
        return brought(process.factory)

    def _try(self, process: Process, place: str, config: Mapping[str, Any]) -> None:
        try:
            if msgpack.unpackb(msgpack.packb(config), strict_map_key=False) != _listed(config):
                raise ValueError("a value changes on its way to the process")
        except (TypeError, ValueError, OverflowError) as error:
            expected = "numbers, texts, lists, and dicts of them, by text"
            raise self._error(process, "config", f"cannot be sent to it ({error})", expected) from None
        try:
            factory = role_factory(place)
        except Exception as error:  # a user's module: its import may raise anything
            what = f"cannot be loaded from {place} ({type(error).__name__}: {error})"
            raise self._error(process, "factory", what, "a class, or module:attribute of one") from error
        try:
            role = factory(**config)
        except ScenarioError:
            raise
        except Exception as error:
            what = f"{place} makes no role of these arguments ({type(error).__name__}: {error})"
            raise self._error(process, "config", what, f"arguments of {place}") from error
        if missing := [name for name in METHODS if not hasattr(role, name)]:
            what = f"what {place} makes has no {', '.join(missing)}"
            raise self._error(process, "factory", what, f"a role: with {', '.join(METHODS)} (trackfield.role.Role)")
        kinds = role.kinds
        if not (isinstance(kinds, Set) and all(isinstance(kind, str) for kind in kinds)):
            what = f"the kinds of what {place} makes are {quoted(kinds)}"
            raise self._error(process, "factory", what, "a frozenset of the names of messages that it takes")

    def _error(self, process: Process, name: str, what: str, expected: str) -> ScenarioError:
        return ScenarioError(what, key=f"{self._key}: {process.id}.{name}", expected=expected)


def _listed(value: Any) -> Any:
    """The same with lists for tuples, as it arrives."""
    if isinstance(value, Mapping):
        return {key: _listed(item) for key, item in value.items()}
    return [_listed(item) for item in value] if isinstance(value, list | tuple) else value
