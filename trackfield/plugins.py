"""Classes by name: Trackfield's own trackers, sensors and architectures, and those that users add.

A name is one of Trackfield's own, one registered in this process, or the entry point of an installed package.
Other processes find a class by its place, ``module:attribute``.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from importlib import import_module
from operator import attrgetter
from typing import TYPE_CHECKING, Any, ClassVar

from trackfield.errors import ScenarioError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

Maker = Callable[..., Any]
"""A class, or another callable that makes a tracker or sensor from its options."""

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,31}")


class _Given:
    """What this process was told: the places of users' classes, whether it may look for installed ones, and the classes
    that it was given itself, by their places.
    """

    places: Mapping[str, str] = {}
    installed = True
    brought: ClassVar[dict[str, Any]] = {}


def give(places: Mapping[str, str], *, installed: bool) -> None:
    """Tell this process where users' classes are: ``module:attribute`` by ``kind:name``, such as ``tracker:mine``.

    From its parent or its command line: a name that comes from the wire is only looked up here, among Trackfield's own
    and, if ``installed``, among the entry points of installed packages, which takes more memory than a node has.
    """
    _Given.places, _Given.installed = dict(places), installed


def place_of(maker: Maker) -> str:
    """``module:attribute`` of a class."""
    return f"{maker.__module__}:{maker.__qualname__}"


def brought(maker: Maker) -> str:
    """The place of a class; this process finds it there from now on, even if it cannot be imported."""
    place = place_of(maker)
    _Given.brought[place] = maker
    return place


def load(place: str) -> Any:
    """What is at ``module:attribute``; raises what the import raises."""
    if place in _Given.brought:
        return _Given.brought[place]
    module, _, attribute = place.partition(":")
    return attrgetter(attribute)(import_module(module))


def importable(place: str) -> bool:
    """Whether another process can import this place: not from within a function, a main program or a notebook."""
    module, _, attribute = place.partition(":")
    return module != "__main__" and "<" not in attribute


class Plugins(Mapping[str, Maker]):
    """The makers of one ``kind`` ("tracker") by name, with the entry points of ``group``; ``own`` cannot be replaced.

    ``former`` names, by which old scenarios have some of ``own``, are accepted and not listed. ``registered`` are
    those of this process only. An entry point is loaded when it is used, not when it is listed.
    """

    def __init__(
        self,
        kind: str,
        group: str,
        own: Mapping[str, Maker],
        methods: tuple[str, ...],
        former: Mapping[str, str] | None = None,
    ) -> None:
        self.kind, self.group, self.own, self.methods = kind, group, dict(own), methods
        self.former = dict(former or {})
        self.registered: dict[str, Maker] = {}

    def register(self, name: str, maker: Maker) -> None:
        """Give ``maker`` a name, in this process; the last registration of a name counts.

        Raises ``ScenarioError`` for a name that is invalid or Trackfield's own, and for a class that lacks a method.
        """
        key = f"register_{self.kind}"
        if not _NAME.fullmatch(name):
            expected = "1 to 32 letters, digits, _ . - (the first a letter or a digit)"
            raise ScenarioError(f"{name!r} is not a valid name for {self._one}", key=key, expected=expected)
        if self.owns(name):
            what = f"{name!r} is {self._one} of Trackfield's own"
            raise ScenarioError(what, key=key, expected="another name")
        self._check(name, maker, key)
        self.registered[name] = maker

    def owns(self, name: str) -> bool:
        """Whether this names one of Trackfield's own, now or formerly."""
        return name in self.own or name in self.former

    def place(self, name: str) -> str:
        """Where other processes find the maker of this name, as ``module:attribute``. Raises as ``[]`` does."""
        if name not in self.registered and name in self._entries:
            return self._entries[name].value
        return place_of(self[name])

    def __getitem__(self, name: str) -> Maker:
        """The maker; raises ``KeyError`` if there is none, ``ScenarioError`` if its package cannot be loaded."""
        for known in (self.own, self.registered):
            if (now := self.former.get(name, name)) in known:
                return known[now]
        place = self._given(name) or self._entries[name].value
        try:
            maker: Maker = load(place)
        except Exception as error:  # a user's module: its import may raise anything
            what = f"cannot be loaded from {place} ({type(error).__name__}: {error})"
            raise ScenarioError(what, key=f"{self.kind} '{name}'") from error
        self._check(name, maker, place)
        return maker

    def __contains__(self, name: object) -> bool:
        known = name in self.own or name in self.former or name in self.registered
        return known or bool(self._given(name)) or name in self._entries

    def __iter__(self) -> Iterator[str]:
        given = (which.partition(":")[2] for which in _Given.places if which.startswith(f"{self.kind}:"))
        return iter(dict.fromkeys((*self.own, *self.registered, *given, *self._entries)))

    def __len__(self) -> int:
        return len(list(iter(self)))

    def unknown(self, name: str, key: str = "") -> ScenarioError:
        """The error for an unknown name."""
        from difflib import get_close_matches

        near = get_close_matches(name, self, n=1)
        expected = f"'{near[0]}'" if near else "one of " + ", ".join(sorted(self))
        return ScenarioError(f"unknown {self.kind} '{name}'", key=key, expected=expected)

    @property
    def _one(self) -> str:
        return f"an {self.kind}" if self.kind[0] in "aeiou" else f"a {self.kind}"

    def _given(self, name: object) -> str | None:
        return _Given.places.get(f"{self.kind}:{name}")

    @property
    def _entries(self) -> dict[str, EntryPoint]:
        return self._installed if _Given.installed else {}

    @cached_property
    def _installed(self) -> dict[str, EntryPoint]:
        from importlib.metadata import entry_points  # late: a node only needs ``load``, and this is heavy

        return {entry.name: entry for entry in entry_points(group=self.group)}

    def _check(self, name: str, maker: Maker, key: str) -> None:
        missing = [m for m in self.methods if isinstance(maker, type) and not hasattr(maker, m)]
        if not callable(maker) or missing:
            lacks = f"has no {', '.join(missing)}" if missing else "is not a class"
            expected = f"a class with {', '.join(self.methods)}"
            raise ScenarioError(f"{self.kind} '{name}' {lacks}", key=key, expected=expected)
