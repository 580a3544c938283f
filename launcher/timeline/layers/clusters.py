"""Masters and slaves: who belongs to whom, who leads and helps, hand-overs, and the ways to the base."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

import numpy as np
import rerun as rr

from launcher.records import JOINED, MASTER, SENSES, FieldInfo, MessageRow
from launcher.timeline import look, rows
from launcher.timeline.scene import Add, Points, Shown
from trackfield.protocols.association.joining import NO_PLACE
from trackfield.wire.clusters import Admit
from trackfield.wire.codec import decoded

HANDED_STEPS: Final = 2
"""For so many steps a hand-over is drawn."""
SLOWER: Final = 10
"""Lines that change seldom are drawn so much more seldom."""
AT_WORK: Final = {"leading": look.CENTRE, "helping": look.HELPING}
"""The states of masters that are marked, and their colours."""
_PATHS: Final = {"member": "/field/members", "way": "/field/ways", "handed": "/field/handed-over"}


class Clusters:
    """Turns states and frames into what is ``shown``, and draws that: kinds ``member``, ``way``, ``handed``, ``leads``.

    ``member`` is slave -> master, ``way`` process -> its last next hop, ``handed`` (from, to) -> True, and ``leads``
    master -> its state, while it leads or helps. ``here`` says whether there are masters.
    """

    def __init__(self, info: FieldInfo, shown: Shown, add: Add) -> None:
        self._shown, self._add, self._step_ns = shown, add, info.step_ns
        self._places = {place.id: (place.x, place.y) for place in info.places}
        self._numbers = {place.id: number for number, place in enumerate(info.tagged(SENSES))}
        self._masters = {place.id for place in info.places if place.role == MASTER}
        self.here = bool(self._masters)

    def state(self, t_ns: int, process: str, name: str) -> None:
        """A master leads or helps, or no more; a slave has no master."""
        if process in self._masters:
            self._shown.show("leads", process, name if name in AT_WORK else None, t_ns)
        elif self.here and process in self._numbers and name not in JOINED:
            self._shown.show("member", process, None, t_ns)

    def message(self, row: MessageRow) -> None:
        """A frame reached its hearer: a slave has a master, a term begins, or something goes on its way to the base."""
        if not self.here or row.outcome not in ("delivered", "late") or row.due_ns is None:
            return
        if row.kind == "admit" and row.dst in self._numbers:
            admit = decoded(row.payload)
            if isinstance(admit, Admit) and admit.sensor == self._numbers[row.dst] and admit.place != NO_PLACE:
                self._shown.show("member", row.dst, row.src, row.due_ns)
        elif row.kind == "hop-ack":  # what was sent got there
            self._shown.show("way", row.dst, row.src, row.due_ns)
        elif row.kind == "hand-over-ack":
            until_ns = row.sent_ns + HANDED_STEPS * self._step_ns
            self._shown.show("handed", (row.dst, row.src), True, row.sent_ns, until_ns)

    def draw(self, kind: str, t_ns: int) -> int:
        """Draw what is shown of this kind; how many points that took."""
        now: Mapping[Any, Any] = self._shown.now[kind]
        if kind == "leads":
            return self._draw_leading(t_ns, now)
        pairs = sorted(now) if kind == "handed" else sorted(now.items())
        known = [pair for pair in pairs if all(end in self._places for end in pair)]
        at: Points = np.reshape([self._places[end] for pair in known for end in pair], (-1, 2, 2))
        self._add(_PATHS[kind], rows.strips, t_ns, at)
        return len(known) if kind == "handed" else SLOWER * len(known)

    def _draw_leading(self, t_ns: int, now: Mapping[str, str]) -> int:
        """Helpers, and above them the leader with its name."""
        names = sorted(now, key=lambda id: (now[id] == "leading", id))
        at: Points = np.reshape([self._places[id] for id in names], (-1, 2))
        labels = [id if now[id] == "leading" else "" for id in names]
        self._add("/field/leading", rows.named_dots, t_ns, (at, [AT_WORK[now[id]] for id in names], labels))
        return len(names)


KINDS: Final = ("member", "way", "handed", "leads")
"""What is drawn, a layer each."""


def styles(info: FieldInfo) -> Iterator[tuple[str, *tuple[rr.AsComponents, ...]]]:
    """How they look; nothing without masters."""
    if not any(place.role == MASTER for place in info.places):
        return
    yield _PATHS["member"], look.line_style(look.MEMBER, 0.8, order=2)
    yield _PATHS["way"], look.line_style(look.WAY, 1.2, order=3)
    yield _PATHS["handed"], look.line_style(look.CENTRE, 2.5, order=26)
    yield "/field/leading", look.point_style(None, 8.0, order=27), rr.Points2D.from_fields(show_labels=True)
