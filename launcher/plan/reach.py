"""Who is in radio reach of whom, and the cells by which their broadcasts are told apart."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from itertools import combinations, pairwise
from math import dist, floor, isfinite
from typing import Final

from trackfield.drivers.spec import ALL, ProcessSpec
from trackfield.errors import ScenarioError
from trackfield.link.fate import Link
from trackfield.link.lognormal_prr import LEAST_SHARE
from trackfield.link.models import reach_m
from trackfield.link.places import Point

MOST_PAIRS: Final = 5_000_000
"""Of processes that hear each other: a minute of a machine's time, and a gigabyte of its memory."""
DENSE: Final = 0.25
"""Where one that moves comes by is looked at so often, in units of the reach."""
Neighbours = Mapping[str, Collection[str]]
"""By id, those of whom frames may come and whom frames may reach, if only in one direction."""


def neighbours(processes: Sequence[ProcessSpec], link: Link, medium: str) -> Neighbours:
    """Who of these processes is in reach of whom on a medium with this link.

    In reach are all pairs of whom one at least hears the other in ``LEAST_SHARE`` of cases; of two of whom one moves,
    all that come as near as the link reaches. Raises ``ScenarioError`` if there are too many pairs for a machine.
    """
    found: dict[str, list[str]] = {process.id: [] for process in processes}
    for one, other in _pairs(processes, link, medium):
        found[one].append(other)
        found[other].append(one)
    return found


def _pairs(processes: Sequence[ProcessSpec], link: Link, medium: str) -> Iterator[tuple[str, str]]:
    reach, ids = reach_m(link), [process.id for process in processes]
    if not isfinite(reach):
        _check(len(ids) * (len(ids) - 1) // 2, medium)
        yield from combinations(ids, 2)
        return
    still = [process for process in processes if not process.legs]
    moving = [process for process in processes if process.legs]
    yield from ((one, other) for one, other in _near(still, reach, medium) if _heard(link, one, other, medium))
    for mover in moving:
        stops = list(_along(mover, DENSE * reach))
        yield from ((mover.id, p.id) for p in still if min(dist((p.x, p.y), at) for at in stops) <= (1 + DENSE) * reach)
    yield from combinations([mover.id for mover in moving], 2)


def _near(still: Sequence[ProcessSpec], reach: float, medium: str) -> Iterator[tuple[str, str]]:
    if len(still) < 2:
        return
    from scipy.spatial import cKDTree

    tree = cKDTree([(process.x, process.y) for process in still])
    _check(int(tree.count_neighbors(tree, reach) - len(still)) // 2, medium)
    for i, j in sorted(tree.query_pairs(reach)):
        yield still[i].id, still[j].id


def _heard(link: Link, one: str, other: str, medium: str) -> bool:
    """Whether one of two that do not move hears the other."""
    return any(link.reception(*ends, 0, medium=medium) >= LEAST_SHARE for ends in ((one, other), (other, one)))


def _along(mover: ProcessSpec, step_m: float) -> Iterator[Point]:
    """Places along its way, at most so far apart."""
    yield mover.legs[0][1:]
    for (_, x0, y0), (_, x1, y1) in pairwise(mover.legs):
        parts = floor(dist((x0, y0), (x1, y1)) / step_m) + 1
        yield from ((x0 + (x1 - x0) * k / parts, y0 + (y1 - y0) * k / parts) for k in range(1, parts + 1))


def _check(pairs: int, medium: str) -> None:
    if pairs > MOST_PAIRS:
        what = f"{pairs} pairs of processes would hear each other's broadcasts"
        section = "link" if medium == "field" else medium
        expected = f"at most {MOST_PAIRS}: a radio or a range_m that does not reach as far"
        raise ScenarioError(what, key=section, expected=expected)


def cells_of(processes: Iterable[ProcessSpec], link: Link) -> dict[str, str]:
    """The cell of each process, by id: squares as wide as the link reaches, and one for each that moves."""
    reach = reach_m(link)
    if not isfinite(reach):
        return {process.id: ALL for process in processes}
    return {p.id: p.id if p.legs else f"x{floor(p.x / reach)}_y{floor(p.y / reach)}" for p in processes}
