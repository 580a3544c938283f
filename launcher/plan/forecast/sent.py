"""Messages of a forecast: single ones, those that come at intervals, and the beacons of a tree."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

from launcher.records import Plan
from trackfield.draw import uniform
from trackfield.role import NEIGHBOURHOOD, NS

ROUTE_SHARE: Final = 0.75
"""Of the interval of the tree's beacons, after which the next one comes on average."""


class Sent(NamedTuple):
    """A message of this ``kind`` and ``size`` (bytes) that leaves at ``t_ns``; to all, if ``dst`` is ``*``."""

    t_ns: int
    src: str
    dst: str
    kind: str
    size: int
    preamble_ns: int = 0


class Again(NamedTuple):
    """What comes at intervals: messages (ns after its beginning), every ``every_ns`` from ``from_ns`` on."""

    from_ns: int
    every_ns: int
    sent: tuple[Sent, ...]


def repeated(again: Sequence[Again], begin_ns: int, end_ns: int) -> Iterator[Sent]:
    """What of this leaves in a time."""
    for from_ns, every_ns, sent in again:
        number = max(-(-(begin_ns - from_ns) // every_ns), 0)
        while (at_ns := from_ns + number * every_ns) < end_ns:
            yield from (one._replace(t_ns=at_ns + one.t_ns) for one in sent)
            number += 1


def trees_again(plan: Plan, sizes: Mapping[str, int]) -> Iterator[Again]:
    """The beacons of those in a tree, from the first step on."""
    for process in _in_trees(plan):
        most_ns = round(ROUTE_SHARE * process.tree["most_ns"])
        phase_ns = round(most_ns * uniform(plan.run.seed, process.id, "forecast", "route"))
        beacon = Sent(0, process.id, NEIGHBOURHOOD, "route", sizes.get("route", 0))
        yield Again(plan.origin_ns + phase_ns, most_ns, (beacon,))


def of_trees(plan: Plan, sizes: Mapping[str, int]) -> Iterator[Sent]:
    """The beacons of those in a tree before the first step."""
    for process in _in_trees(plan):
        now, interval_ns = round(NS * uniform(plan.run.seed, process.id, "forecast", "tree")), process.tree["least_ns"]
        while now < plan.origin_ns:
            yield Sent(now, process.id, NEIGHBOURHOOD, "route", sizes.get("route", 0))
            now += round(ROUTE_SHARE * interval_ns)
            interval_ns = min(2 * interval_ns, process.tree["most_ns"])


def _in_trees(plan: Plan) -> list[Any]:
    return [process for process in plan.processes if process.tree and not process.incarnation]
