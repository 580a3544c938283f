"""Fields that hear targets pass, as the run goes on: who leads, to whom interests lead, and what goes along them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

import numpy as np
import rerun as rr

from launcher.records import EAR, FieldInfo, MessageRow
from launcher.timeline import look, rows
from launcher.timeline.layers.clusters import SLOWER
from launcher.timeline.layers.heads import arrow
from launcher.timeline.scene import Add, Points, Shown
from trackfield.protocols.collection.links import text_of
from trackfield.role import NS
from trackfield.wire.codec import decoded
from trackfield.wire.interests import Interest
from trackfield.wire.passes import FIXES, PASSES

LANE: Final = "hearing"
"""The lane of states of the role that may lead."""
LEADING: Final = "leading"
CARRIED_NS: Final = NS
"""For so long data is drawn on its way."""
_PATHS: Final = {PASSES: "/field/wanted-passes", FIXES: "/field/wanted-fixes"}
_COLOURS: Final = {PASSES: look.POLLED, FIXES: look.WAY}


class Hearing:
    """Turns states and frames into what is ``shown``, and draws that: kinds ``gradient``, ``carried``, ``heads``.

    ``gradient`` is (process, sink, number of the interest) -> (class of data, the neighbour from which it has the
    interest), as long as that lives; ``carried`` (from, to) -> True; ``heads`` process -> True while it leads.
    ``here`` says whether there are such nodes.
    """

    def __init__(self, info: FieldInfo, shown: Shown, add: Add) -> None:
        self._shown, self._add = shown, add
        self._places = {place.id: (place.x, place.y) for place in info.places}
        self._ears = {place.id for place in info.places if place.role == EAR}
        self._first: dict[tuple[str, str, int], int] = {}  # the latest refresh of an interest that each process has
        self.here = bool(self._ears)

    def state(self, t_ns: int, process: str, name: str, lane: str) -> bool:
        """A process entered a state; whether it is one of who may lead, which is drawn here alone."""
        if process not in self._ears or (lane != LANE and name != look.DEAD):
            return False
        self._shown.show("heads", process, True if name == LEADING else None, t_ns)
        return lane == LANE

    def message(self, row: MessageRow) -> None:
        """A frame reached its hearer: an interest, of which the first copy sets the gradient, or data."""
        if not self.here or row.outcome not in ("delivered", "late") or row.due_ns is None:
            return
        if row.kind == "data":
            self._shown.show("carried", (row.src, row.dst), True, row.due_ns, row.due_ns + CARRIED_NS)
        elif row.kind == "interest":
            interest = decoded(row.payload)
            if isinstance(interest, Interest):
                self._heard(row, row.due_ns, interest)

    def _heard(self, row: MessageRow, at_ns: int, interest: Interest) -> None:
        sink = text_of(interest.sink)
        key = row.dst, sink, interest.number
        if sink == row.dst or self._first.get(key) == interest.refresh:
            return
        self._first[key] = interest.refresh
        until_ns = at_ns + round(interest.lasts_s * NS)
        self._shown.show("gradient", key, (interest.task, row.src), at_ns, until_ns)

    def draw(self, kind: str, t_ns: int) -> int:
        """Draw what is shown of this kind; how many points that took."""
        now: Mapping[Any, Any] = self._shown.now[kind]
        if kind == "heads":
            names = [id for id in sorted(now) if id in self._places]
            at: Points = np.reshape([self._places[id] for id in names], (-1, 2))
            self._add("/field/leading", rows.named_dots, t_ns, (at, [look.CENTRE] * len(names), names))
            return len(names)
        if kind == "carried":
            found = [arrow(self._places[a], self._places[b]) for a, b in sorted(now) if self._known(a, b)]
            self._add("/field/carried", rows.strips, t_ns, np.reshape(found, (-1, 5, 2)))
            return len(found)
        for task, path in _PATHS.items():
            pairs = sorted({(id, to) for (id, _, _), (what, to) in now.items() if what == task and self._known(id, to)})
            ends = [self._places[end] for pair in pairs for end in pair]
            self._add(path, rows.strips, t_ns, np.reshape(ends, (-1, 2, 2)))
        return len(now) * SLOWER

    def _known(self, *ids: str) -> bool:
        return all(id in self._places for id in ids)


KINDS: Final = ("gradient", "carried", "heads")
"""What is drawn, a layer each."""


def ears(info: FieldInfo) -> bool:
    """Whether there are such nodes."""
    return any(place.role == EAR for place in info.places)


def styles(info: FieldInfo) -> Iterator[tuple[str, *tuple[rr.AsComponents, ...]]]:
    """How they look; nothing without such nodes."""
    if not ears(info):
        return
    for order, (task, path) in enumerate(_PATHS.items()):
        yield path, look.line_style(_COLOURS[task], 2.4 - order, order=2 + order)
    yield "/field/carried", look.line_style(look.TARGET, 2.0, order=26)
    yield "/field/leading", look.point_style(None, 8.0, order=22), rr.Points2D.from_fields(show_labels=True)
