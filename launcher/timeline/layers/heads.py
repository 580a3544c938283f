"""Nodes of which any may lead: who does, whom it polls, who claims to lead, hand-overs, and the ways to a base."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Final

import numpy as np
import rerun as rr

from launcher.records import PEER, SENSES, FieldInfo, MessageRow
from launcher.timeline import look, rows
from launcher.timeline.layers.clusters import HANDED_STEPS, SLOWER
from launcher.timeline.scene import Add, Points, Shown
from trackfield.wire.codec import decoded
from trackfield.wire.peers import Claim, Poll

LANE: Final = "header"
"""The lane of states of the role that may lead."""
LEADING: Final = "leading"
ELECTING: Final = "electing"
EVENTS: Final = "/heads"
"""The entity of what happens to terms, in words, and of the lane of who leads."""
NEWS: Final = re.compile(r"\bterm \d+")
"""What is in each note that is about a term."""
BARB: Final = 0.18
"""The length of an arrow's barbs over that of the arrow."""
_PATHS: Final = {"polled": "/field/polled", "way": "/field/ways", "arrow": "/field/handed-over"}


class Heads:
    """Turns states and frames into what is ``shown``, and draws that: kinds ``head``, ``claim``, ``polled``, ``arrow``
    and ``way``.

    ``head`` is process -> True while it leads, ``claim`` process -> True from its claim until its election is over,
    ``polled`` head -> the sensors that it has measure, ``arrow`` (from, to) -> True for a while after a hand-over, and
    ``way`` process -> its last next hop. ``here`` says whether any node may lead. ``words`` are those of the lane of
    who leads, and their colours.
    """

    def __init__(self, info: FieldInfo, shown: Shown, add: Add) -> None:
        self._shown, self._add = shown, add
        self._step_ns, self._origin_ns = info.step_ns, info.origin_ns
        self._places = {place.id: (place.x, place.y) for place in info.places}
        self._sensors = [place.id for place in info.tagged(SENSES)]
        self._peers = {place.id for place in info.places if place.role == PEER}
        self._told: dict[tuple[str, str], int] = {}  # when each sent its last claim or poll that is drawn
        self.words: dict[str, int] = {}
        self.here = bool(self._peers)

    def state(self, t_ns: int, process: str, name: str, lane: str) -> bool:
        """A process entered a state; whether it is one of a header, which is drawn here alone."""
        if process not in self._peers or lane != LANE:
            if process in self._peers and name == look.DEAD:
                self._header(t_ns, process, name)
            return False
        self._header(t_ns, process, name)
        return True

    def _header(self, t_ns: int, process: str, name: str) -> None:
        self._shown.show("head", process, True if name == LEADING else None, t_ns)
        if name != ELECTING:
            self._shown.show("claim", process, None, t_ns)

    def note(self, t_ns: int, process: str, text: str, level: str) -> None:
        """A process notes something; what is about a term is news."""
        if process in self._peers and NEWS.search(text):
            self._news(t_ns, text if text.startswith(f"{process} ") else f"{process}: {text}", level)

    def _news(self, t_ns: int, text: str, level: str = "INFO") -> None:
        self._add(EVENTS, rows.texts, t_ns, (text, level, look.LEVELS[level]))

    def message(self, row: MessageRow) -> None:
        """A frame was sent, whether it reached its hearer or not; a broadcast comes once for each."""
        if not self.here:
            return
        if row.kind in ("claim", "poll"):
            if self._told.get((row.src, row.kind), -1) != row.sent_ns:
                self._told[row.src, row.kind] = row.sent_ns
                self._said(row)
        elif row.kind == "hand-over-ack":
            until_ns = row.sent_ns + HANDED_STEPS * self._step_ns
            self._shown.show("arrow", (row.dst, row.src), True, row.sent_ns, until_ns)
        elif row.kind == "hop-ack" and row.outcome in ("delivered", "late") and row.due_ns is not None:
            self._shown.show("way", row.dst, row.src, row.due_ns)

    def _said(self, row: MessageRow) -> None:
        match decoded(row.payload):
            case Claim(number, key):
                self._shown.show("claim", row.src, True, row.sent_ns, row.sent_ns + HANDED_STEPS * self._step_ns)
                self._news(row.sent_ns, f"{row.src} claims term {number}, with key {key}")
            case Poll(_, step, sensors):
                over_ns = self._origin_ns + (step + 1) * self._step_ns
                self._shown.show("polled", row.src, self._ids(sensors), row.sent_ns, over_ns)

    def _ids(self, sensors: bytes) -> tuple[str, ...]:
        numbers = (int.from_bytes(sensors[i : i + 2], "little") for i in range(0, len(sensors), 2))
        return tuple(self._sensors[one] for one in numbers if one < len(self._sensors))

    def draw(self, kind: str, t_ns: int) -> int:
        """Draw what is shown of this kind; how many points that took."""
        now: Mapping[Any, Any] = self._shown.now[kind]
        if kind in ("head", "claim"):
            return self._rings(t_ns)
        if kind == "arrow":
            found = [arrow(*(self._places[end] for end in pair)) for pair in sorted(now) if self._known(pair)]
            self._add(_PATHS[kind], rows.strips, t_ns, np.reshape(found, (-1, 5, 2)))
            return len(found)
        pairs = sorted(now.items()) if kind == "way" else [(head, id) for head in sorted(now) for id in now[head]]
        ends = [self._places[end] for pair in pairs if self._known(pair) and pair[0] != pair[1] for end in pair]
        self._add(_PATHS[kind], rows.strips, t_ns, np.reshape(ends, (-1, 2, 2)))
        return len(ends) // 2 * (SLOWER if kind == "way" else 1)

    def _known(self, pair: Iterable[str]) -> bool:
        return all(end in self._places for end in pair)

    def _rings(self, t_ns: int) -> int:
        """Those that claim to lead, and above them the heads with their names; and the lane of who leads."""
        heads, claims = sorted(self._shown.now["head"]), sorted(self._shown.now["claim"])
        names = [id for id in claims if id not in heads]
        at: Points = np.reshape([self._places[id] for id in (*names, *heads) if id in self._places], (-1, 2))
        colours = [look.ELECTING] * len(names) + [look.CENTRE] * len(heads)
        self._add("/field/heads", rows.named_dots, t_ns, (at, colours, [*[""] * len(names), *heads]))
        word = " and ".join(heads) or ("election" if claims else "")
        if word:
            self.words[word] = (look.CENTRE if len(heads) == 1 else look.LOST) if heads else look.ELECTING
        self._add(EVENTS, rows.states, t_ns, word)
        return len(at)


KINDS: Final = ("head", "claim", "polled", "arrow", "way")
"""What is drawn, a layer each."""


def any_may_lead(info: FieldInfo) -> bool:
    """Whether there are such nodes."""
    return any(place.role == PEER for place in info.places)


def styles(info: FieldInfo) -> Iterator[tuple[str, *tuple[rr.AsComponents, ...]]]:
    """How they look; nothing without such nodes."""
    if not any_may_lead(info):
        return
    yield _PATHS["polled"], look.line_style(look.POLLED, 1.5, order=3)
    yield _PATHS["way"], look.line_style(look.WAY, 1.2, order=2)
    yield _PATHS["arrow"], look.line_style(look.CENTRE, 2.5, order=26)
    ring = look.point_style(None, max(look.dot(info), 2.5) + 3.5, order=22)
    yield "/field/heads", ring, rr.Points2D.from_fields(show_labels=True)


def arrow(start: tuple[float, float], end: tuple[float, float]) -> Points:
    """An arrow as one line, (5, 2)."""
    tip = np.array(end, float)
    back = BARB * (np.array(start, float) - tip)
    aside = np.array([-back[1], back[0]]) / 2
    return np.array([start, tip, tip + back + aside, tip, tip + back - aside])
