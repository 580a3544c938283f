"""Fixes as a head tells them: what its trackers know after an event, and the raw reports that it is from."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Final

from head.beliefs import packed_beliefs
from head.hearing.memory import Pass
from trackfield.filters.belief import Belief
from trackfield.filters.passes.types import REASONS
from trackfield.role import NS, TrackPoint
from trackfield.wire.passes import FixReport
from trackfield.wire.raw import Raw, pack

MOST_BELIEF: Final = 900
"""Bytes of a belief: with the reports and the fields around it a fix still fits into a message of diffusion."""
OTHER: Final = 255
"""The reason of a tracker that has words of its own."""


def fix_report(
    number: int,
    step: int,
    at_ns: int,
    beliefs: Mapping[str, Belief | None],
    closed: Iterable[TrackPoint],
    raw: Sequence[tuple[int, Pass]],
) -> FixReport:
    """The message of an event after a ``step``, which was ``at_ns``.

    ``closed`` are the points in which trackers say how it ended, ``raw`` the reports with the numbers of their sensors.
    The beliefs are those of trackers that have a fix, and the reason is that of the first one that has none.
    """
    refused = {point.tracker: point.refused for point in closed if point.refused}
    known = {name: one for name, one in beliefs.items() if one is not None and name not in refused}
    rows = [Raw(i, (at_ns - one.at_ns) / NS, one.report.strength_db, one.report.width_s) for i, one in raw]
    return FixReport(number, step, _reason(refused), _fitting(step, known), pack(rows))


def _reason(refused: Mapping[str, str]) -> int:
    why = next(iter(refused.values()), "")
    return REASONS.index(why) if why in REASONS else OTHER


def _fitting(step: int, known: Mapping[str, Belief]) -> bytes:
    """The beliefs of the first trackers, of as many as fit; empty if there are none."""
    names = list(known)
    while names:
        packed = packed_beliefs(step, {name: known[name] for name in names})
        if len(packed) <= MOST_BELIEF:
            return packed
        names.pop()
    return b""
