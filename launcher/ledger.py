"""The ledger: every frame accounted for.

Fate being pure, the ledger computes what became of each (frame, hearer) from the frame alone; what depends on the
hearer's state (asleep, refused as late) it takes from the hearer's telemetry, and the hearers' own counters are the
cross-check. It sees a run through ``sent``, ``told`` and ``final``, from Zenoh or from the virtual driver alike.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from heapq import heappop, heappush
from typing import Any, NamedTuple

from launcher.records import MessageRow
from trackfield.drivers.core import LATE
from trackfield.drivers.frames import EventKey, Frame, Refused, Told, Undone
from trackfield.drivers.spec import ProcessSpec, RunSpec, places_of
from trackfield.link.models import make_link
from trackfield.role import Note, Publish, Radio, State
from trackfield.wire.codec import WireError, decode
from trackfield.wire.messages import Doa


@dataclass(frozen=True, slots=True)
class Event:
    """Settled telemetry: what a process told at true time ``t_ns``."""

    t_ns: int
    process: str
    effect: State | Publish | Note


@dataclass(slots=True)
class Diary:
    """What one process told, in the order of its events."""

    told: list[Told] = field(default_factory=list)
    radio: list[Told] = field(default_factory=list)
    refused: dict[EventKey, str] = field(default_factory=dict)
    passed: int = 0  # how many of ``told`` were handed on as settled

    def undo(self, since: EventKey) -> None:
        """Forget what it told from this event on."""
        for tail in (self.told, self.radio):
            while tail and tail[-1].key >= since:
                tail.pop()
        self.passed = min(self.passed, len(self.told))
        for key in [k for k in self.refused if k >= since]:
            del self.refused[key]

    def listens(self, medium: str, t_ns: int) -> bool:
        """Whether the radio was on for a frame due at ``t_ns``: a change at t counts after t."""
        before = bisect_left(self.radio, t_ns, key=lambda o: o.key[0])
        for told in reversed(self.radio[:before]):
            if isinstance(told.effect, Radio) and told.effect.medium == medium:
                return told.effect.on
        return True


class Ledger:
    """Accounts of one run; ``rows`` grows as outcomes settle."""

    def __init__(self, run: RunSpec, processes: Sequence[ProcessSpec]) -> None:
        self.run = run
        self.rows: list[MessageRow] = []
        self.sent_by: Counter[str] = Counter()
        self.sent_kinds: Counter[str] = Counter()
        self.payload_max: Counter[str] = Counter()
        self.payload_bytes = 0
        self.finals: dict[str, dict[str, Any]] = {}
        self.counts: dict[str, dict[str, int]] = {}
        self.dead: set[str] = set()
        self._processes = {p.id: p for p in processes}
        self._listeners = [p for p in processes if p.cells]
        self._diaries: dict[str, Diary] = defaultdict(Diary)
        self._link = make_link(run.link, run.seed, places_of(processes))
        self._pending: list[tuple[int, int, Frame, MessageRow]] = []
        self._order = 0

    # --- what is seen ---------------------------------------------------------------------------------------------

    def sent(self, frame: Frame, *, again: bool = False) -> None:
        """A frame left; ``again`` if it is one more address of a transmission already counted."""
        if not again:
            self.sent_by[frame.src] += 1
            self.sent_kinds[frame.kind] += 1
            self.payload_bytes += len(frame.payload)
            self.payload_max[frame.kind] = max(self.payload_max[frame.kind], len(frame.payload))
        said = describe(frame.payload)
        for hearer in self._hearers(frame):
            self._expect(frame, hearer, said)

    def told(self, process: str, output: Told | Refused | Undone) -> None:
        """A process told something."""
        diary = self._diaries[process]
        if isinstance(output, Told):
            (diary.radio if isinstance(output.effect, Radio) else diary.told).append(output)
        elif isinstance(output, Refused):
            diary.refused[output.key] = output.reason
        else:
            diary.undo(output.key)

    def end(self, end_ns: int) -> None:
        """The run was ended early, at this true time."""
        self.run = replace(self.run, end_ns=min(end_ns, self.run.end_ns))

    def final(self, process: str, record: Mapping[str, Any]) -> None:
        """A process's last word."""
        self.finals[process] = dict(record)

    def estimates(self) -> list[tuple[int, str, Publish]]:
        """All that was published: (true time ns, process, estimate), in time order."""
        published = [
            (o.key[0], process, o.effect)
            for process, diary in self._diaries.items()
            for o in diary.told
            if isinstance(o.effect, Publish)
        ]
        return sorted(published, key=lambda item: item[:2])

    # --- what is settled ------------------------------------------------------------------------------------------

    def settle(self, until_ns: int) -> tuple[list[MessageRow], list[Event]]:
        """What is final up to this true time and was not handed out before, each in time order."""
        rows = []
        while self._pending and self._pending[0][0] <= until_ns:
            _, _, frame, row = heappop(self._pending)
            rows.append(self._judge(frame, row))
        self.rows += rows
        events = [event for id, diary in self._diaries.items() for event in _pass_on(id, diary, until_ns)]
        return rows, sorted(events, key=lambda event: event.t_ns)

    def close(self, dead: Iterable[str] = ()) -> tuple[list[MessageRow], list[Event]]:
        """Settle all; ``dead`` names processes that died unplanned, which got only what they had counted."""
        self.dead = set(dead)
        rows, events = self.settle(max([self.run.end_ns, *(p[0] for p in self._pending)]))
        for id in self.dead:
            self._bury(id)
        return rows, events

    def host_lost(self) -> int:
        """Frames that should have reached a process which says that they did not."""
        due: Counter[str] = Counter(r.dst for r in self.rows if r.delivered or r.outcome == "asleep")
        return sum(
            max(due[id] - record.get("delivered", 0) - record.get("asleep", 0), 0) for id, record in self.finals.items()
        )

    def dropped(self) -> int:
        """Frames that left a process and never reached the recorder."""
        return sum(max(r.get("sent", 0) - self.sent_by[id], 0) for id, r in self.finals.items())

    # --- the account of one frame ---------------------------------------------------------------------------------

    def _hearers(self, frame: Frame) -> list[str]:
        to, src = frame.addresses, self._processes.get(frame.src)
        cell = src.cell if src else ""
        asked = self._listeners if to is None else [self._processes[i] for i in to if i in self._processes]
        return [p.id for p in asked if p.hears(frame.medium, to, frame.src, cell)]

    def _expect(self, frame: Frame, hearer: str, said: Said) -> None:
        outcome, due = "in_flight", None
        if frame.sent_ns < self.run.end_ns:
            fate = frame.fate(self._link, hearer)
            outcome, due = fate.cause or "delivered", None if fate.cause else frame.sent_ns + fate.delay_ns
        row = MessageRow(
            frame.kind,
            frame.src,
            hearer,
            frame.medium,
            frame.sent_ns,
            due,
            outcome,
            len(frame.payload),
            frame.copy,
            frame.incarnation,
            *said,
        )
        self._order += 1
        heappush(self._pending, (due or frame.sent_ns, self._order, frame, row))

    def _judge(self, frame: Frame, row: MessageRow) -> MessageRow:
        if row.due_ns is None:
            return row
        if row.due_ns >= self.run.end_ns:
            return replace(row, outcome="in_flight")
        diary = self._diaries.get(row.dst)
        if diary is None:
            return row
        if not diary.listens(frame.medium, row.due_ns):
            return replace(row, outcome="asleep")
        reason = diary.refused.get(frame.key(row.due_ns))
        if reason is None:
            return row
        return replace(row, outcome="late" if reason == LATE else "ignored")

    def _bury(self, id: str) -> None:
        """A process that died unplanned got the first frames that it counted, and no more."""
        got = self.counts.get(id, {}).get("delivered", 0)
        mine = [i for i, r in enumerate(self.rows) if r.dst == id and r.delivered]
        for i in sorted(mine, key=lambda i: self.rows[i].due_ns or 0)[got:]:
            self.rows[i] = replace(self.rows[i], outcome="dead")


class Said(NamedTuple):
    """What is in a payload: in words, and if it is a DOA report its bearing (degrees) and step."""

    text: str
    bearing_deg: float | None = None
    step: int | None = None


def describe(payload: bytes) -> Said:
    """A payload for a person; never raises."""
    try:
        message = decode(payload)
    except WireError as error:
        return Said(f"malformed ({error.reason})")
    if isinstance(message, Doa):
        text = f"DOA {message.bearing_deg:.1f} deg {message.level_db:.1f} dB"
        return Said(text, message.bearing_deg, message.step)
    return Said(repr(message))


def _pass_on(id: str, diary: Diary, until_ns: int) -> list[Event]:
    ready = []
    while diary.passed < len(diary.told) and diary.told[diary.passed].key[0] <= until_ns:
        told = diary.told[diary.passed]
        diary.passed += 1
        assert not isinstance(told.effect, Radio)
        ready.append(Event(told.key[0], id, told.effect))
    return ready
