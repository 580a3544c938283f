"""Where the roles of a field are made: installed ones, and those of a user's architecture."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Set
from functools import cache
from importlib.metadata import entry_points
from typing import Any, Final, NamedTuple

import msgpack

from launcher.plan.architectures import Process
from trackfield.drivers.spec import factory_of
from trackfield.errors import ScenarioError
from trackfield.plugins import brought, load
from trackfield.words import quoted

METHODS: Final = ("kinds", "begin", "handle")
"""What every role has."""
SINGLE: Final = {"sync-request": "tells the time", "sync-reply": "asks for the time"}
"""Messages that one role of a process handles, and what it does with them."""


@cache
def installed(role: str) -> str:
    """Where an installed package makes roles of this name. Raises ``ScenarioError`` if none does."""
    for entry in entry_points(group="trackfield.roles", name=role):
        return entry.value
    expected = "a Process with a factory, or an entry point in trackfield.roles"
    raise ScenarioError(f"no installed package offers the role {role!r}", expected=expected)


class _Made(NamedTuple):
    """A role to be made: where it stands in the arrangement, its name, what makes it, with which arguments."""

    where: str
    role: str
    factory: str | Callable[..., Any]
    config: Mapping[str, Any]


class Roles:
    """Finds what makes each role of a run, and checks that it does; ``key`` names the architecture in errors.

    Of an installed role one is made for each set of arguments, of a user's own each one.
    """

    def __init__(self, key: str) -> None:
        self._key = key
        self._good: dict[tuple[str, frozenset[str], bool], frozenset[str]] = {}

    def factory(self, process: Process, config: Mapping[str, Any]) -> str:
        """``ProcessSpec.factory`` of what makes a process with these arguments. Raises ``ScenarioError``."""
        if not process.roles:
            return self._checked(_Made(process.id, process.role, process.factory, config))[0]
        places, kinds = dict[str, str](), dict[str, Set[str]]()
        for name, hosted in process.roles.items():
            one = _Made(f"{process.id}.roles.{name}", name, hosted.factory, config[name])
            places[name], kinds[name] = self._checked(one, follows=hosted.clock == "follows")
        for kind, does in SINGLE.items():
            if len(several := [name for name, taken in kinds.items() if kind in taken]) > 1:
                what = f"each of {', '.join(several)} {does}"
                raise self._error(process.id, "roles", what, "one role that does, and clock = 'follows' for others")
        return factory_of(places)

    def _checked(self, one: _Made, *, follows: bool = False) -> tuple[str, frozenset[str]]:
        """Where a role is made, and the kinds of messages that it takes."""
        given = one.factory
        place = installed(one.role) if not given else given if isinstance(given, str) else self._place(one)
        arguments = place, frozenset(one.config), follows
        if given or arguments not in self._good:
            self._good[arguments] = self._try(one, place, follows=follows)
        return place, self._good[arguments]

    def _place(self, one: _Made) -> str:
        if not callable(one.factory):
            raise self._error(one.where, "factory", f"is {one.factory!r}", "a class, or module:attribute")
        return brought(one.factory)

    def _try(self, one: _Made, place: str, *, follows: bool) -> frozenset[str]:
        """The kinds of messages that a role takes. Raises ``ScenarioError`` if it cannot be made, or is none."""
        try:
            if msgpack.unpackb(msgpack.packb(one.config), strict_map_key=False) != _listed(one.config):
                raise ValueError("a value changes on its way to the process")
        except (TypeError, ValueError, OverflowError) as error:
            expected = "numbers, texts, lists, and dicts of them, by text"
            raise self._error(one.where, "config", f"cannot be sent to it ({error})", expected) from None
        try:
            factory = load(place)
        except Exception as error:  # a user's module: its import may raise anything
            what = f"cannot be loaded from {place} ({type(error).__name__}: {error})"
            raise self._error(one.where, "factory", what, "a class, or module:attribute of one") from error
        try:
            role = factory(**one.config)
        except ScenarioError:
            raise
        except Exception as error:
            what = f"{place} makes no role of these arguments ({type(error).__name__}: {error})"
            raise self._error(one.where, "config", what, f"arguments of {place}") from error
        return self._kinds(one, place, role, follows=follows)

    def _kinds(self, one: _Made, place: str, role: Any, *, follows: bool) -> frozenset[str]:
        if missing := [name for name in METHODS if not hasattr(role, name)]:
            what = f"what {place} makes has no {', '.join(missing)}"
            raise self._error(one.where, "factory", what, f"a role: with {', '.join(METHODS)} (trackfield.role.Role)")
        kinds = role.kinds
        if not (isinstance(kinds, Set) and all(isinstance(kind, str) for kind in kinds)):
            what = f"the kinds of what {place} makes are {quoted(kinds)}"
            raise self._error(one.where, "factory", what, "a frozenset of the names of messages that it takes")
        if follows and not getattr(role, "follows", False):
            expected = "a role with an attribute follows that is true, which takes ClockSet"
            raise self._error(one.where, "clock", f"what {place} makes does not follow a clock", expected)
        return frozenset(kinds)

    def _error(self, where: str, name: str, what: str, expected: str) -> ScenarioError:
        return ScenarioError(what, key=f"{self._key}: {where}.{name}", expected=expected)


def _listed(value: Any) -> Any:
    """The same with lists for tuples, as it arrives."""
    if isinstance(value, Mapping):
        return {key: _listed(item) for key, item in value.items()}
    return [_listed(item) for item in value] if isinstance(value, list | tuple) else value
