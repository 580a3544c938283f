"""What an architecture arranged, checked before anything is made of it: one clear error for what cannot be."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from itertools import pairwise
from math import isfinite
from numbers import Real
from typing import Any, Final

from launcher.plan.architectures.arranged import Arranged, Process
from launcher.plan.references import check_references
from launcher.records import BACKBONE, BATTERY, SENSES, TRACKS
from trackfield.errors import ScenarioError
from trackfield.files import FAR_M
from trackfield.scenario import Site
from trackfield.scenario.nearest import suggestion
from trackfield.scenario.places import RESERVED
from trackfield.scenario.quantities import MOST_NODES
from trackfield.scenario.section import ID, ID_WORDS
from trackfield.words import quoted

TAGS: Final = (TRACKS, BATTERY, BACKBONE, SENSES)
MOST_COMPARED: Final = 10_000
"""Of more ids, none is suggested for an unknown one: it takes long."""


def checked(kind: str, arranged: Any, site: Site) -> Arranged:
    """What the architecture ``kind`` arranged. Raises ``ScenarioError`` if it is none, or contradicts itself."""
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
        processes = self._listed("arrange", given.processes, "processes")
        if len(processes) > MOST_NODES:
            raise self._error("arrange", f"returned {len(processes)} processes", f"at most {MOST_NODES}")
        for process in processes:
            self._identity(process)
            self._processes[process.id] = process
        for process in processes:
            self._process(process)
        if not any(process.senses for process in processes):
            raise self._error("arrange", "no process has a sensor", "processes that sense (field.sensor_nodes)")
        check_references({process.id: process.asks or None for process in processes}, self._key)
        self._views(given.views)
        return given

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

    def _process(self, process: Process) -> None:
        id = process.id
        for name in ("x", "y"):
            value = getattr(process, name)
            if not (_number(value) and abs(value) <= FAR_M):
                raise self._error(f"{id}.{name}", f"is {quoted(value)}", f"metres, at most {FAR_M:g} from (0, 0)")
        if process.senses and self._sensors.get(id) != (process.x, process.y):
            known = "has another place" if id in self._sensors else "is not in this field"
            raise self._error(f"{id}.senses", f"the sensor {id} {known}", "the id and place of one of field.sensors")
        for sensor in self._listed(f"{id}.fuses", process.fuses, "ids of sensors"):
            if sensor not in self._sensors:
                raise self._unknown(f"{id}.fuses", "sensor", sensor, self._sensors)
        self._sends(process)
        self._tags(process)
        if process.asks and (process.asks not in self._processes or process.asks == id):
            raise self._unknown(f"{id}.asks", "other process", process.asks, self._processes)
        self._route(process)

    def _sends(self, process: Process) -> None:
        if not isinstance(process.sends, Mapping):
            raise self._error(
                f"{process.id}.sends", f"is {quoted(process.sends)}", "lists of ids by the kind of message"
            )
        for kind, ids in process.sends.items():
            for id in self._listed(f"{process.id}.sends", ids, f"ids that get its messages of kind {kind}"):
                if id not in self._processes or id == process.id:
                    raise self._unknown(f"{process.id}.sends", "other process", id, self._processes)

    def _tags(self, process: Process) -> None:
        for tag in self._listed(f"{process.id}.tags", process.tags, "tags"):
            if tag not in TAGS:
                raise self._unknown(f"{process.id}.tags", "tag", tag, TAGS)
        battery_j = process.battery_j
        if battery_j is not None and not (_number(battery_j) and battery_j > 0):
            raise self._error(f"{process.id}.battery_j", f"is {quoted(battery_j)}", "joules, above 0; or None")
        if battery_j is not None and BATTERY not in process.tags:
            raise self._error(f"{process.id}.battery_j", "is given without the tag 'battery'", "both, or none of them")

    def _route(self, process: Process) -> None:
        legs = self._listed(f"{process.id}.route", process.route, "legs (t ns, x m, y m)")
        good = [isinstance(leg, tuple) and len(leg) == 3 and all(map(_number, leg)) for leg in legs]
        if not all(good) or any(b[0] <= a[0] for a, b in pairwise(legs)):
            expected = "legs (t ns, x m, y m) in increasing time"
            raise self._error(f"{process.id}.route", f"is {quoted(process.route)}", expected)

    def _views(self, views: Mapping[Any, Any]) -> None:
        if not views:
            raise self._error("views", "there is none", "at least one: the headline, such as {'base': ['fusion']}")
        for name, sources in views.items():
            if not (isinstance(name, str) and re.fullmatch(ID, name)):
                raise self._error("views", f"the name of a view is {quoted(name)}", ID_WORDS)
            ids = self._listed(f"views.{name}", sources, "ids of processes that track")
            if not ids:
                raise self._error(f"views.{name}", "is empty", "the id of at least one process that tracks")
            for id in ids:
                if id not in self._processes:
                    raise self._unknown(f"views.{name}", "process", id, self._processes)
                if TRACKS not in self._processes[id].tags:
                    what = f"{id} publishes no tracks"
                    raise self._error(f"views.{name}", what, f"processes with the tag '{TRACKS}'")

    def _listed(self, where: str, given: Any, what: str) -> list[Any]:
        """The entries of a list, tuple or set; a text would be a list of its letters."""
        if isinstance(given, str | Mapping) or not isinstance(given, Iterable):
            raise self._error(where, f"is {quoted(given)}", f"a list of {what}")
        return list(given)

    def _unknown(self, where: str, what: str, name: Any, known: Collection[str]) -> ScenarioError:
        near = suggestion(name, known) if isinstance(name, str) and len(known) <= MOST_COMPARED else ""
        few = [*_first(known, 3), *(["..."] if len(known) > 3 else [])]
        return self._error(where, f"there is no {what} {quoted(name)}{near}", f"one of {', '.join(few)}")


def _first(names: Iterable[str], count: int) -> Iterator[str]:
    return (name for name, _ in zip(names, range(count), strict=False))


def _number(value: object) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool) and isfinite(value)
