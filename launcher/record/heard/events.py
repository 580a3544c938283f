"""The events of a run: whose reports they are, what trackers made of them, and what ECPA chose from."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import isfinite, log
from typing import Final

import numpy as np

from launcher.heard import Event, Line, Outcome, Report, Tried
from launcher.plan.forecast.hearing.events import APART_NS
from launcher.record.figures.passes.ended import Ended, ended
from launcher.record.figures.passes.metrics import base_of
from launcher.record.heard.reports import Told, told
from launcher.record.tables import TrackRow
from launcher.records import MessageRow, Plan
from trackfield.filters.passes.ecpa import candidates
from trackfield.filters.passes.geometry import state
from trackfield.filters.passes.types import Passes, event_of
from trackfield.role import NS
from trackfield.world.events import ENOUGH

PER_DB: Final = log(10.0) / 20.0
"""The natural logarithm of an amplitude, per dB."""


def events_of_run(plan: Plan, tracks: Iterable[TrackRow], frames: Iterable[MessageRow]) -> list[Event]:
    """In the order of their ends; none where sensors report no passes."""
    if not plan.info.hears:
        return []
    frames_told = told(plan, frames)
    found: dict[tuple[str, int], list[Ended]] = {}
    for one in ended(tracks, base_of(plan)):
        found.setdefault((one.row.point.source, one.row.t_ns), []).append(one)
    return [_event(plan, those, frames_told) for those in found.values()]


def _event(plan: Plan, those: Sequence[Ended], frames: Told) -> Event:
    order = {name: number for number, name in enumerate(plan.info.trackers)}
    those = sorted(those, key=lambda one: order.get(one.row.point.tracker, len(order)))
    first = those[0]
    source, step = first.row.point.source, plan.step_of(first.row.t_ns)
    known = {place.id for place in plan.info.places}
    heard = frames.of(source, step, first.sensors, first.event_ns, APART_NS)
    reports = tuple(one for one in heard if one.sensor in known)
    outcomes = tuple(_outcome(one) for one in those)
    return Event(source, reports, outcomes, _tried(plan, reports) if len(reports) >= ENOUGH else None)


def _outcome(one: Ended) -> Outcome:
    point = one.row.point
    known = one.row.has_track and not one.refused
    x, y, vx, vy = point.mean[:4] if known else (0.0, 0.0, 0.0, 0.0)
    line = (x, y, vx, vy) if known else None
    covariance = point.covariance[:16] if known and len(point.covariance) == 16 else ()
    return Outcome(point.tracker, point.at_ns, one.row.told_ns, one.event_ns, one.refused, line, covariance)


def _tried(plan: Plan, reports: Sequence[Report]) -> Tried | None:
    """What ECPA considers, whichever the trackers are; None if it finds no far sensors across the path."""
    places = {place.id: (place.x, place.y) for place in plan.info.places}
    count, begin_ns = len(reports), reports[0].at_ns
    event = event_of(
        Passes(
            np.array([places[one.sensor] for one in reports]),
            np.array([(one.at_ns - begin_ns) / NS for one in reports]),
            np.exp(PER_DB * np.array([one.strength_db for one in reports])),
            np.ones(count),
            np.ones(count),
        )
    )
    with np.errstate(all="ignore"):
        found = candidates(event, _sound_m_s(plan))
        lines = state(found.lines)
    lines[:, :2] += event.centroid
    straight: list[Line] = [(x, y, vx, vy) for x, y, vx, vy in lines.tolist() if all(map(isfinite, (x, y, vx, vy)))]
    if not straight:
        return None
    far = tuple(reports[int(number)].sensor for number in found.far)
    return Tried(reports[int(found.lone)].sensor, far, tuple(straight))


def _sound_m_s(plan: Plan) -> float:
    """The speed of sound that sensors assume."""
    options = next(iter(plan.tracking["sensing"].values()))["options"]
    return float(options.get("sound_m_s", 340.0)) or float("inf")
