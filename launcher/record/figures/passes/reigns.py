"""Who led clusters that hear passes, as the points of their tracks tell it: a term there is a fix, and not a reign."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Final, NamedTuple

from launcher.record.figures.terms import START, TAKE_OVER, Life, Point, Turn
from trackfield.role import NS

APART_NS: Final = 5 * NS
"""Where clusters form for an event, a head that was silent for so long leads another one."""


class Reign(NamedTuple):
    """That a process led from ``turn.begun_ns`` to ``until_ns``; the turn's number counts the heads of its cluster."""

    turn: Turn
    until_ns: int


def reigns(points: Iterable[Point], clusters: Sequence[Sequence[str]], last: Mapping[Life, int]) -> list[Reign]:
    """In the order in which they began.

    One that led a fixed cluster after another took over; falsely, if that one was still there by ``last``, when each
    life said something last. Without fixed clusters each event has a head of its own.
    """
    ordered = sorted(points, key=lambda one: one.told_ns)
    if clusters:
        found = [reign for group in clusters for reign in _of_cluster([p for p in ordered if p.source in group], last)]
    else:
        found = [reign for id in {p.source: None for p in ordered} for reign in _of_events(ordered, id)]
    return sorted(found, key=lambda reign: (reign.turn.begun_ns, reign.turn.leader))


def _of_cluster(points: Iterable[Point], last: Mapping[Life, int]) -> list[Reign]:
    found, before = list[Reign](), None
    for one in points:
        if before is None or before.source != one.source:
            false = before is not None and last.get((before.source, before.incarnation), -1) >= one.told_ns
            how = START if before is None else TAKE_OVER
            found.append(Reign(Turn(len(found) + 1, one.source, one.told_ns, how, false), one.told_ns))
        found[-1] = found[-1]._replace(until_ns=one.told_ns)
        before = one
    return found


def _of_events(points: Iterable[Point], id: str) -> list[Reign]:
    found = list[Reign]()
    for one in points:
        if one.source != id:
            continue
        if not found or one.told_ns - found[-1].until_ns > APART_NS:
            found.append(Reign(Turn(len(found) + 1, id, one.told_ns, START), one.told_ns))
        found[-1] = found[-1]._replace(until_ns=one.told_ns)
    return found
