"""The events of a run, as far as they follow from the paths: which sensors of which cluster will report a pass."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import groupby
from math import dist, inf
from typing import Final, NamedTuple

import numpy as np

from head.hearing.choice import EVENT_NS, event_begins
from launcher.plan.forecast.heard import Heard
from launcher.plan.forecast.hearing.reached import Reached
from launcher.records import SENSES, Passing, Plan
from trackfield.role import NS
from trackfield.world.path import Path

APART_NS: Final = 5 * NS
"""Reports that are further apart are of different events."""
LOOKED_NS: Final = NS // 10
"""Where a target comes nearest is looked for in such steps."""

Point = tuple[float, float]


class Report(NamedTuple):
    """A sensor ``id`` will report at ``at_ns`` that this target (its number) passed."""

    at_ns: int
    id: str
    target: int


class Event(NamedTuple):
    """A target passes the cluster of ``head``: when (ns) which sensors report that, in the order of their times.

    ``missed`` are the sensors of a fixed cluster that do not, and how near (m) the target comes to them then.
    """

    target: str
    head: str
    heard: Mapping[str, int]
    missed: Mapping[str, float]

    @property
    def last_ns(self) -> int:
        """When the last report leaves."""
        return max(self.heard.values())


def reports_of(plan: Plan) -> list[Report]:
    """All reports that are to be expected, in their order."""
    places = plan.info.tagged(SENSES)
    heard = Heard.of(plan, [place.id for place in places], np.array([(place.x, place.y) for place in places]))
    rows = zip(heard.t_ns.tolist(), heard.sensor.tolist(), heard.target.tolist(), strict=True)
    return sorted(
        Report(plan.passes[id][plan.step_of(t_ns)], id, target)
        for t_ns, sensor, target in rows
        for id in (places[sensor].id,)
    )


def events_of(plan: Plan, passing: Passing) -> list[Event]:
    """The events in the order of their last reports."""
    reports = reports_of(plan)
    found = _around_loudest(plan, passing, reports) if passing.loudest else _of(passing.clusters, plan, reports)
    return sorted(found, key=lambda event: (event.last_ns, event.head))


def events_in(plan: Plan) -> list[Event]:
    """Those of a plan, in their order; where no clusters form, all sensors count as one."""
    if isinstance(plan.schedule, Passing):
        return events_of(plan, plan.schedule)
    everyone = tuple(place.id for place in plan.info.tagged(SENSES))
    return sorted(_of([everyone], plan, reports_of(plan)), key=lambda event: event.last_ns)


def _of(clusters: Iterable[tuple[str, ...]], plan: Plan, reports: Sequence[Report]) -> Iterator[Event]:
    """Those of fixed clusters."""
    paths, places = list(plan.paths.items()), _places(plan)
    for group in clusters:
        mine = sorted((one for one in reports if one.id in group), key=lambda one: (one.target, one.at_ns))
        for number, those in groupby(mine, key=lambda one: one.target):
            target, path = paths[number]
            for heard in _apart(those):
                span = min(heard.values()) - APART_NS, max(heard.values()) + APART_NS
                missed = {id: nearest_m(path, places[id], *span) for id in group if id not in heard}
                yield Event(target, group[0], heard, missed)


def _apart(reports: Iterable[Report]) -> Iterator[dict[str, int]]:
    """The reports of one target by one cluster, event by event: a sensor reports once in each."""
    heard = dict[str, int]()
    for one in reports:
        if heard and (one.id in heard or one.at_ns - max(heard.values()) > APART_NS):
            yield heard
            heard = {}
        heard = {**heard, one.id: one.at_ns}
    if heard:
        yield heard


def _places(plan: Plan) -> dict[str, Point]:
    return {place.id: (place.x, place.y) for place in plan.info.places}


def _around_loudest(plan: Plan, passing: Passing, reports: Sequence[Report]) -> Iterator[Event]:
    """Those of clusters that form around the loudest sensors, which are taken to be the nearest.

    A sensor leads when it heard of no report for a while, after those of its neighbours that are louder, unless another
    head has its report by then. A head may use reports that one before it used, too.
    """
    paths, places, reached = list(plan.paths.items()), _places(plan), Reached.of(plan)
    away = {one: nearest_m(paths[one.target][1], places[one.id], one.at_ns - APART_NS, one.at_ns) for one in reports}

    def due(one: Report) -> tuple[int, float, str]:
        near = _together(one, [other for other in reports if other.id in (one.id, *reached.near[one.id])])
        louder = sum(away[other] < away[one] for other in near)
        return max(other.at_ns for other in near) + passing.close_ns + louder * passing.turn_ns, away[one], one.id

    left = sorted(reports, key=due)
    while left:
        head = left[0]
        hops, reach_m = reached.hops(head.id), 2.0 * plan.reaches[head.id]
        near = [
            one
            for one in reports
            if dist(places[one.id], places[head.id]) <= reach_m and one.id in hops and hops[one.id] <= passing.most_hops
        ]
        event = _together(head, near)
        heard = {**{one.id: one.at_ns for one in event}, head.id: head.at_ns}
        yield Event(paths[head.target][0], head.id, heard, {})
        left = [one for one in left if one not in event]


def _together(own: Report, reports: Iterable[Report]) -> list[Report]:
    """Those of the same event as one of them, as its sensor sees it."""
    same = [one for one in reports if one.target == own.target]
    since_ns = event_begins(own.at_ns, [one.at_ns for one in same])
    return [one for one in same if 0 <= one.at_ns - since_ns <= EVENT_NS]


def nearest_m(path: Path, place: Point, begin_ns: int, end_ns: int) -> float:
    """How near (m) a target comes to a place in this time; infinite if it is not there."""
    states = (path.at(t_ns / NS) for t_ns in range(begin_ns, end_ns + 1, LOOKED_NS))
    return min((dist(state[:2], place) for state in states if state is not None), default=inf)
