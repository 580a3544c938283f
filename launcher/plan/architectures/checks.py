"""What an architecture arranged, checked before anything is made of it: one clear error for what cannot be."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Set
from dataclasses import replace
from itertools import pairwise
from math import isfinite
from numbers import Real
from typing import Any, Final

from launcher.plan.architectures.arranged import Arranged, Hosted, Process
from launcher.plan.architectures.ports import checked_ports
from launcher.plan.references import check_references
from launcher.records import BACKBONE, BATTERY, SENSES, TRACKS, Passing, Polls, Schedule
from trackfield.errors import ScenarioError
from trackfield.files import FAR_M
from trackfield.link.fate import FIELD
from trackfield.protocols.collection.piece import KINDS
from trackfield.role import NEIGHBOURHOOD
from trackfield.scenario import Site
from trackfield.scenario.nearest import suggestion
from trackfield.scenario.places import RESERVED
from trackfield.scenario.quantities import MOST_NODES
from trackfield.scenario.section import ID, ID_WORDS
from trackfield.wire.keys import MEDIA, Medium
from trackfield.words import quoted

TAGS: Final = (TRACKS, BATTERY, BACKBONE, SENSES)
CLOCKS: Final = ("", "keeps", "follows")
MOST_COMPARED: Final = 10_000
"""Of more ids, none is suggested for an unknown one: it takes long."""
LEAST_J: Final = 1e-6
MOST_J: Final = 1e9
"""The capacity of a battery, as in ``[energy]``."""


def checked(kind: str, arranged: Any, site: Site) -> Arranged:
    """What the architecture ``kind`` arranged, with tuples and dicts for whatever it used in their place.

    Raises ``ScenarioError`` if it is none, or contradicts itself.
    """
    return _Check(f"architecture '{kind}'", site).arranged(arranged)


class _Check:
    """Checks of what an architecture with this name arranged for a field."""

    def __init__(self, key: str, site: Site) -> None:
        self._key = key
        self._sensors = {id: (x, y) for id, x, y in site.sensors}
        self._processes: dict[str, Process] = {}

    def arranged(self, given: Any) -> Arranged:
        if not isinstance(given, Arranged) or not isinstance(given.views, Mapping):
            raise self._error("arrange", f"returned {quoted(given)}", "an Arranged of processes and views")
        listed = self._listed("arrange", given.processes, "processes")
        if len(listed) > MOST_NODES:
            raise self._error("arrange", f"returned {len(listed)} processes", f"at most {MOST_NODES}")
        for process in listed:
            self._identity(process)
            media = self._names(f"{process.id}.media", process.media, "medium", MEDIA)
            self._processes[process.id] = replace(process, media=media)
        processes = tuple(self._process(process) for process in self._processes.values())
        self._processes = {process.id: process for process in processes}
        if not any(process.senses for process in processes):
            raise self._error("arrange", "no process has a sensor", "processes that sense (field.sensor_nodes)")
        check_references({process.id: process.asks or None for process in processes}, self._key)
        if given.schedule is not None and not isinstance(given.schedule, Schedule | Polls | Passing):
            raise self._error(
                "arrange", f"its schedule is {quoted(given.schedule)}", "a Schedule, Polls, Passing, or None"
            )
        return Arranged(processes, self._views(given.views), given.schedule)

    def _error(self, where: str, what: str, expected: str) -> ScenarioError:
        return ScenarioError(what, key=f"{self._key}: {where}", expected=expected)

    def _identity(self, process: Any) -> None:
        if not isinstance(process, Process):
            raise self._error("arrange", f"{quoted(process)} is among its processes", "each a Process")
        id = process.id
        for name, text in (("id", id), ("role", process.role)):
            if not (isinstance(text, str) and re.fullmatch(ID, text)):
                raise self._error("arrange", f"the {name} of a process is {quoted(text)}", ID_WORDS)
        if id in RESERVED:
            others = ", ".join(RESERVED)
            raise self._error(id, "this id names another process of the run", f"an id other than {others}")
        if id in self._processes:
            raise self._error(id, "two processes have this id", "an id of its own for each")

    def _process(self, process: Process) -> Process:
        id = process.id
        for name in ("x", "y"):
            value = getattr(process, name)
            if not (_number(value) and abs(value) <= FAR_M):
                raise self._error(f"{id}.{name}", f"is {quoted(value)}", f"metres, at most {FAR_M:g} from (0, 0)")
        if process.senses and self._sensors.get(id) != (process.x, process.y):
            known = "has another place" if id in self._sensors else "is not in this field"
            raise self._error(f"{id}.senses", f"the sensor {id} {known}", "the id and place of one of field.sensors")
        self._config(id, process.config)
        roles = self._roles(process)
        tags = self._names(f"{id}.tags", process.tags, "tag", TAGS)
        self._battery(process, tags)
        self._asks(process)
        self._base(process)
        for name in ("carries", "managed"):
            self._arguments(f"{id}.{name}", getattr(process, name))
        sends, hears = self._sends(process), self._kinds(f"{id}.hears", process.hears)
        direct = self._kinds(f"{id}.direct", process.direct)
        if process.base:
            sends = {**sends, **dict.fromkeys(KINDS, (NEIGHBOURHOOD,))}
            hears = tuple(dict.fromkeys((*hears, *KINDS)))
        checked = replace(
            process,
            sends=sends,
            over=self._over(process, sends),
            hears=hears,
            direct=direct,
            fuses=self._names(f"{id}.fuses", process.fuses, "sensor", self._sensors),
            tags=tags,
            route=self._route(process),
            roles=roles,
            ports=checked_ports(process, self._error),
        )
        if roles:
            self._shared(checked)
        return checked

    def _asks(self, process: Process) -> None:
        """It asks another process for the time, over a medium that both have."""
        id, asks, medium = process.id, process.asks, process.asks_over
        if asks == "":
            return
        if not isinstance(asks, str) or asks not in self._processes or asks == id:
            raise self._unknown(f"{id}.asks", "other process", asks, self._processes)
        for end in (id, asks):
            if medium not in self._processes[end].media:
                what = f"is {quoted(medium)}, which {end} does not have"
                raise self._error(f"{id}.asks_over", what, "a medium that both ends have (media)")

    def _base(self, process: Process) -> None:
        """A tree leads to a process that is in it, and goes by radio."""
        base, where = process.base, f"{process.id}.base"
        if base == "":
            return
        if not isinstance(base, str) or base not in self._processes:
            raise self._unknown(where, "process", base, self._processes)
        root = self._processes[base].base
        if root != base:
            expected = f"{base!r} for {base} itself, too, and for all others of the tree"
            raise self._error(where, f"is {base!r}, whose own base is {quoted(root)}", expected)
        if FIELD not in process.media:
            raise self._error(where, "is given without the radio of the field", "media with 'field'")

    def _config(self, where: str, config: Any) -> None:
        self._arguments(f"{where}.config", config, "its role's arguments")

    def _arguments(self, where: str, given: Any, what: str = "arguments") -> None:
        if not (isinstance(given, Mapping) and all(isinstance(name, str) for name in given)):
            raise self._error(where, f"is {quoted(given)}", f"a dict of {what} by name")

    def _roles(self, process: Process) -> dict[str, Hosted]:
        """The roles of a process with several."""
        roles, where = process.roles, f"{process.id}.roles"
        if not (isinstance(roles, Mapping) and all(isinstance(role, Hosted) for role in roles.values())):
            raise self._error(where, f"is {quoted(roles)}", "a dict of a Hosted for each role by its name")
        for name, role in roles.items():
            if not (isinstance(name, str) and re.fullmatch(ID, name)):
                raise self._error(where, f"the name of a role is {quoted(name)}", ID_WORDS)
            self._config(f"{where}.{name}", role.config)
            if role.clock not in CLOCKS:
                raise self._error(f"{where}.{name}.clock", f"is {quoted(role.clock)}", "keeps, follows, or ''")
        if roles and (process.factory or process.config):
            raise self._error(where, "are given beside a factory or a config", "those of each role in its Hosted")
        return dict(roles)

    def _shared(self, process: Process) -> None:
        """Of several roles it must be clear which one gets what the launcher adds."""
        roles, where = process.roles, f"{process.id}.roles"
        fusing = [name for name, role in roles.items() if role.fuses]
        if len(fusing) != bool(process.fuses):
            expected = "one with fuses = True if the process fuses reports, and else none"
            raise self._error(where, f"reports are fused by {_few(fusing)}", expected)
        keepers = [name for name, role in roles.items() if role.clock == "keeps"]
        needed = bool(process.asks) or any(role.clock == "follows" for role in roles.values())
        if len(keepers) > 1 or (needed and not keepers):
            expected = "one with clock = 'keeps' if the process asks for the time or a role follows"
            raise self._error(where, f"the clock is kept by {_few(keepers)}", expected)

    def _sends(self, process: Process) -> dict[str, tuple[str, ...]]:
        given, where = process.sends, f"{process.id}.sends"
        if not (isinstance(given, Mapping) and all(isinstance(kind, str) for kind in given)):
            raise self._error(where, f"is {quoted(given)}", "lists of ids by the kind of message, a text")
        sends = {kind: self._receivers(where, ids) for kind, ids in given.items()}
        if any(process.id in ids for ids in sends.values()):
            raise self._unknown(where, "other process", process.id, self._processes)
        return sends

    def _receivers(self, where: str, given: Any) -> tuple[str, ...]:
        ids = self._listed(where, given, "names, each that of one other process")
        every = (NEIGHBOURHOOD,) if NEIGHBOURHOOD in ids else ()
        named = [id for id in (sorted(ids, key=str) if isinstance(given, Set) else ids) if id != NEIGHBOURHOOD]
        return (*every, *self._names(where, named, "other process", self._processes))

    def _over(self, process: Process, sends: Mapping[str, Iterable[str]]) -> dict[str, Medium]:
        """The media of its messages; those to whom it sends them have them, too."""
        over, where = process.over, f"{process.id}.over"
        if not (isinstance(over, Mapping) and all(kind in sends for kind in over)):
            raise self._error(where, f"is {quoted(over)}", "a medium by the kind of message, of those that it sends")
        for kind, ids in sends.items():
            medium = over.get(kind, FIELD)
            for id in (process.id, *ids):
                if id != NEIGHBOURHOOD and medium not in self._processes[id].media:
                    what = f"{kind} goes over {quoted(medium)}, which {id} does not have"
                    raise self._error(where, what, "a medium that both ends have (media)")
        return dict(over)

    def _kinds(self, where: str, given: Any) -> tuple[str, ...]:
        kinds = self._listed(where, given, "kinds of messages")
        if not all(isinstance(kind, str) for kind in kinds):
            raise self._error(where, f"is {quoted(given)}", "a list of kinds of messages")
        return tuple(sorted(set(kinds)))

    def _battery(self, process: Process, tags: Collection[str]) -> None:
        battery_j, where = process.battery_j, f"{process.id}.battery_j"
        if battery_j is None:
            return
        if not (_number(battery_j) and LEAST_J <= battery_j <= MOST_J):
            raise self._error(where, f"is {quoted(battery_j)}", f"joules from {LEAST_J:g} to {MOST_J:g}, or None")
        if BATTERY not in tags:
            raise self._error(where, "is given without the tag 'battery'", "both, or none of them")

    def _route(self, process: Process) -> tuple[tuple[int, float, float], ...]:
        legs = self._listed(f"{process.id}.route", process.route, "legs (t ns, x m, y m)")
        good = [isinstance(leg, tuple | list) and len(leg) == 3 and all(map(_number, leg)) for leg in legs]
        if not all(good) or any(b[0] <= a[0] for a, b in pairwise(legs)):
            expected = "legs (t ns, x m, y m) in increasing time"
            raise self._error(f"{process.id}.route", f"is {quoted(process.route)}", expected)
        if far := [leg for leg in legs if max(abs(leg[1]), abs(leg[2])) > FAR_M]:
            raise self._error(
                f"{process.id}.route", f"leads to {quoted(far[0][1:])}", f"at most {FAR_M:g} m from (0, 0)"
            )
        if legs and tuple(legs[0][1:]) != (process.x, process.y):
            expected = f"its x and y, ({process.x:g}, {process.y:g})"
            raise self._error(f"{process.id}.route", f"begins at {quoted(tuple(legs[0][1:]))}", expected)
        return tuple((t, x, y) for t, x, y in legs)

    def _views(self, views: Mapping[Any, Any]) -> dict[str, tuple[str, ...]]:
        if not views:
            raise self._error("views", "there is none", "at least one: the headline, such as {'base': ['fusion']}")
        return {name: self._view(name, sources) for name, sources in views.items()}

    def _view(self, name: Any, sources: Any) -> tuple[str, ...]:
        if not (isinstance(name, str) and re.fullmatch(ID, name)):
            raise self._error("views", f"the name of a view is {quoted(name)}", ID_WORDS)
        ids = self._names(f"views.{name}", sources, "process", self._processes)
        if not ids:
            raise self._error(f"views.{name}", "is empty", "the id of at least one process that tracks")
        for id in ids:
            if TRACKS not in self._processes[id].tags:
                what = f"{id} publishes no tracks"
                raise self._error(f"views.{name}", what, f"processes with the tag '{TRACKS}'")
        return ids

    def _names(self, where: str, given: Any, what: str, known: Collection[str]) -> tuple[str, ...]:
        """The entries of a list of names that are known, each of them once; of a set, in their order."""
        names = self._listed(where, given, f"names, each that of one {what}")
        for name in names:
            if not isinstance(name, str) or name not in known:
                raise self._unknown(where, what, name, known)
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise self._error(where, f"{quoted(twice)} is there twice", "each of them once")
        return tuple(sorted(names) if isinstance(given, Set) else names)

    def _listed(self, where: str, given: Any, what: str) -> list[Any]:
        """The entries of a list, tuple or set; a text would be a list of its letters."""
        if isinstance(given, str | Mapping) or not isinstance(given, Iterable):
            raise self._error(where, f"is {quoted(given)}", f"a list of {what}")
        return list(given)

    def _unknown(self, where: str, what: str, name: Any, known: Collection[str]) -> ScenarioError:
        near = suggestion(name, known) if isinstance(name, str) and len(known) <= MOST_COMPARED else ""
        few = [*_first(known, 3), *(["..."] if len(known) > 3 else [])]
        return self._error(where, f"there is no {what} {quoted(name)}{near}", f"one of {', '.join(few)}")


def _few(names: Collection[str]) -> str:
    return " and ".join(names) or "none"


def _first(names: Iterable[str], count: int) -> Iterator[str]:
    return (name for name, _ in zip(names, range(count), strict=False))


def _number(value: object) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool) and isfinite(value)
