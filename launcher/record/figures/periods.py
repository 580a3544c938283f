"""The periods of a run: its set-up, while a target is there, and while none is."""

from __future__ import annotations

from typing import Final, NamedTuple

from launcher.records import Plan
from trackfield.role import NS

SETUP: Final = "setup"
PRESENT: Final = "present"
SETTLING: Final = "settling"
IDLE: Final = "idle"
PERIODS: Final = (SETUP, PRESENT, SETTLING, IDLE)
FEWEST: Final = 10
"""A stretch without a target that is shorter than so many steps says nothing of an idle field."""


class Span(NamedTuple):
    """A part of a run, from ``begin_ns`` up to ``end_ns``."""

    period: str
    begin_ns: int
    end_ns: int


def spans_of(plan: Plan, end_ns: int) -> tuple[Span, ...]:
    """The parts of a run that ended at ``end_ns``, in order, without holes.

    A target counts as there until one step after the end of its path, which is when its last track is due. In the
    first half of each stretch without a target the field gives its track up; in the second half of the longest one it
    is idle. Where nobody knows where a target was, one is always there.
    """
    edges = [(SETUP, 0, plan.origin_ns)]
    begin = plan.origin_ns
    for there_ns, gone_ns in _there(plan, end_ns):
        edges += [(SETTLING, begin, there_ns), (PRESENT, there_ns, gone_ns)]
        begin = gone_ns
    edges.append((SETTLING, begin, end_ns))
    spans = [Span(period, a, min(b, end_ns)) for period, a, b in edges if a < min(b, end_ns)]
    longest = max((one for one in spans if one.period == SETTLING), key=_length, default=None)
    if longest is None or _length(longest) < FEWEST * plan.step_ns:
        return tuple(spans)
    place, middle = spans.index(longest), (longest.begin_ns + longest.end_ns) // 2
    halves = [Span(SETTLING, longest.begin_ns, middle), Span(IDLE, middle, longest.end_ns)]
    return (*spans[:place], *halves, *spans[place + 1 :])


def _length(span: Span) -> int:
    return span.end_ns - span.begin_ns


def _there(plan: Plan, end_ns: int) -> list[tuple[int, int]]:
    """When any target is there, from the first step on: (from ns, until ns), in order and disjoint."""
    if not plan.paths:
        return [(plan.origin_ns, end_ns)]
    own = sorted(
        (max(round(path.start_s * NS), plan.origin_ns), round(path.end_s * NS) + plan.step_ns)
        for path in plan.paths.values()
    )
    found: list[tuple[int, int]] = []
    for begin, end in own:
        if found and begin <= found[-1][1]:
            found[-1] = found[-1][0], max(end, found[-1][1])
        else:
            found.append((begin, end))
    return found
