"""The ledger: every frame accounted for.

As the fate of a frame is a pure function, the ledger computes what became of each frame at each receiver from the frame
alone; what depends on the receiver's state (asleep, refused as late) it takes from the receiver's telemetry, and the
receivers' own counters are the cross-check. Its input are ``sent``, ``told`` and ``final``, from Zenoh or from the
virtual driver alike.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from heapq import heappop, heappush
from typing import Any, Final, NamedTuple

from launcher.record.diary import Diary, Event
from launcher.records import MessageRow
from trackfield.drivers.frames import LATE, Died, Frame, Overflowed, Refused, Told, Undone
from trackfield.drivers.spec import ProcessSpec, RunSpec, life_name, link_of, places_of
from trackfield.role import Publish, TrackPoint
from trackfield.sensing.complete import Kind
from trackfield.sensing.kinds import SENSORS, known_kind
from trackfield.wire.codec import WireError, decode
from trackfield.wire.keys import id_of
from trackfield.wire.messages import Measurement, SyncReply, SyncRequest, Threshold, Track

FRAMES: Final = "frames"
"""Interference: frames in the name of a process that did not send them."""
TELEMETRY: Final = "telemetry"
"""Interference: telemetry that no process of the run sent."""
ANSWERS: Final = "answers"
"""Interference: answers to processes in the launcher's place."""
FORGED: Final = ("future", "conflict", "life")
"""Reasons to refuse a frame that bears the name of a process of the run."""
SYNCHRONISING: Final = ("sync-request", "sync-reply")
"""Kinds of messages by which clocks are set; they leave while the clock is still wrong."""


class Published(NamedTuple):
    """A point of a track, when (true time) and by which life of which process it was published."""

    told_ns: int
    source: str
    incarnation: int
    point: TrackPoint


class Ledger:
    """The frames of one run; ``rows`` grows as outcomes settle."""

    def __init__(self, run: RunSpec, processes: Sequence[ProcessSpec]) -> None:
        self.run = run
        self.rows: list[MessageRow] = []
        self.sent_by: Counter[str] = Counter()
        self.sent_kinds: Counter[str] = Counter()
        self.payload_max: Counter[str] = Counter()
        self.payload_bytes = 0
        self.on_air = 0
        self.sent_bytes: defaultdict[str, tuple[int, int]] = defaultdict(lambda: (0, 0))
        self.finals: dict[str, dict[str, Any]] = {}
        self.counts: dict[str, dict[str, int]] = {}
        self.diaries = {p.name: Diary(p) for p in processes}
        self.clock_errors: dict[tuple[int, str], int] = {}
        self.refused: Counter[str] = Counter()
        self._interfered: Counter[str] = Counter()
        self._told_by: Counter[str] = Counter()
        self.link = link_of(run, places_of(processes))
        self._processes = {p.id: p for p in processes}
        self._lives: defaultdict[str, list[Diary]] = defaultdict(list)
        for p in processes:
            self._lives[p.id].append(self.diaries[p.name])
        self._listeners = [p for p in self._processes.values() if p.cells]
        self._kinds: dict[str, Kind | None] = {}
        self._timed = {p.id for p in processes if p.clock or p.jumps}
        self._written: dict[str, None] = {}
        self._kills = sorted((p.kill_ns, p.name) for p in processes if p.kill_ns is not None)
        self._pending: list[tuple[int, int, Frame, MessageRow]] = []
        self._order = 0

    # --- what is seen ---------------------------------------------------------------------------------------------

    def sent(self, frame: Frame) -> None:
        """A frame left."""
        self.sent_by[life_name(frame.src, frame.incarnation)] += 1
        self.sent_kinds[frame.kind] += 1
        self.payload_bytes += len(frame.payload)
        self.payload_max[frame.kind] = max(self.payload_max[frame.kind], len(frame.payload))
        cost = frame.cost(self.link)
        self.on_air += cost.bytes_on_air
        size, frames = self.sent_bytes[frame.src]
        self.sent_bytes[frame.src] = size + len(frame.payload), frames + 1
        said, local_ns = describe(frame.payload, self._kind(frame.src)), self._local_ns(frame)
        for hearer in self._hearers(frame):
            outcome, due = "in_flight", None
            if frame.sent_ns < self.run.end_ns:
                fate = cost if hearer == frame.to else frame.fate(self.link, hearer)
                outcome, due = fate.cause or "delivered", None if fate.cause else frame.sent_ns + fate.delay_ns
            self._await(frame, _row(frame, hearer, outcome, due, said, local_ns))

    def told(self, process: str, output: Told | Refused | Undone) -> None:
        """Telemetry of a process."""
        self.diaries[process].write(output)
        self._written[process] = None
        self._told_by[process] += 1

    def life(self, spec: ProcessSpec) -> None:
        """A process that died unplanned lives again: it gets the frames due from then on. May be called twice."""
        if spec.name in self.diaries:
            return
        for diary in self._lives[spec.id]:
            if diary.owns(spec.start_ns):
                diary.spec = replace(diary.spec, kill_ns=spec.start_ns)
        self.diaries[spec.name] = Diary(spec)
        self._lives[spec.id].append(self.diaries[spec.name])

    def end(self, end_ns: int) -> None:
        """The run was ended early, at this true time."""
        self.run = replace(self.run, end_ns=min(end_ns, self.run.end_ns))

    def final(self, process: str, record: Mapping[str, Any]) -> None:
        """The final record of a process; another one of the same life is not from it."""
        self._interfered[TELEMETRY] += self.finals.get(process, record) != record
        self.finals[process] = dict(record)

    def check(self, frame: Frame) -> None:
        """Raise ``WireError`` unless a process of the run may have sent this frame to those that it is for."""
        if frame.src not in self._processes:
            raise WireError("sender", "no process of this run")
        self.check_life(life_name(frame.src, frame.incarnation))
        hearer = self._processes.get(frame.to)
        if not frame.broadcast and (hearer is None or frame.src not in hearer.peers):
            raise WireError("receiver", "not one to which its sender sends")

    def check_life(self, name: str) -> None:
        """Raise ``WireError`` unless there is such a life: ``process`` if there is no such process, or ``life``."""
        if id_of(name) not in self._processes:
            raise WireError("process", "not of this run")
        if name not in self.diaries:
            raise WireError("life", "not of this run")

    def refuse(self, key: str, reason: str, times: int = 1) -> None:
        """Samples on this key were refused. Frames are, by ``refused``; some of them, and all else, interfere."""
        if not key.startswith("data/"):
            self._interfered[TELEMETRY] += 0 if key.startswith("control/") else times  # the launcher counts orders
            return
        self.refused[reason] += times
        self._interfered[FRAMES] += times if reason in FORGED else 0

    def interference(self) -> dict[str, int]:
        """What others did in the run, by kind: what was refused, and what is more than the processes say they sent."""
        finals = self.finals.items()
        frames = sum(max(self.sent_by[name] - record["sent"], 0) for name, record in finals if "sent" in record)
        told = sum(max(self._told_by[name] - record["told"], 0) for name, record in finals if "told" in record)
        return {
            FRAMES: self._interfered[FRAMES] + frames,
            TELEMETRY: self._interfered[TELEMETRY] + told,
            ANSWERS: sum(record.get("forged", 0) for _, record in finals),
        }

    def estimates(self) -> list[Published]:
        """All that was published, in the order of time."""
        published = [
            Published(told.key[0], diary.spec.id, diary.spec.incarnation, told.effect.estimate)
            for diary in self.diaries.values()
            for told in diary.told
            if isinstance(told.effect, Publish)
        ]
        return sorted(published, key=lambda one: (one.told_ns, one.source))

    # --- what is settled ------------------------------------------------------------------------------------------

    def settle(self, until_ns: int) -> tuple[list[MessageRow], list[Event]]:
        """What is final up to this true time and was not returned before, each in time order."""
        rows = []
        while self._pending and self._pending[0][0] <= until_ns:
            _, _, frame, row = heappop(self._pending)
            rows.append(self._judge(frame, row))
        events: list[Event] = []
        while self._kills and self._kills[0][0] <= min(until_ns, self.run.end_ns):
            kill_ns, name = heappop(self._kills)
            if self.diaries[name].died is None:
                events.append(Event(kill_ns, self.diaries[name].spec.id, Died("killed")))
        for name in list(self._written):
            diary = self.diaries[name]
            events += diary.settled(until_ns)
            if diary.passed == len(diary.told):
                del self._written[name]
        for event in events:
            if isinstance(event.effect, Overflowed):
                rows += self._overflowed(event.effect.frame)
        self.rows += rows
        return rows, sorted(events, key=lambda event: event.t_ns)

    def close(self, dead: Iterable[str] = ()) -> tuple[list[MessageRow], list[Event]]:
        """Settle all; ``dead`` names lives that ended unplanned, which got only what they had counted."""
        rows, events = self.settle(max([self.run.end_ns, *(p[0] for p in self._pending)]))
        for name in set(dead) & self.diaries.keys():
            self._bury(name)
        return rows, events

    def sums(self) -> dict[str, int]:
        """How many frames were ``expected``, ``delivered`` and ``host_lost``.

        The machine lost a frame that the recorder saw and a receiver did not get, and one that neither of them saw. A
        frame that only the recorder missed was delivered.
        """
        due: Counter[str] = Counter()
        for row in self.rows:
            if row.delivered or row.outcome == "asleep":
                owner = self._owner(row)
                due[owner.spec.name if owner else ""] += 1
        more = [r.get("delivered", 0) + r.get("asleep", 0) - due[name] for name, r in self.finals.items()]
        missed, unseen = sum(-n for n in more if n < 0), self.dropped()
        heard_alone = min(sum(n for n in more if n > 0), unseen)
        return {
            "expected": len(self.rows) + unseen,
            "delivered": sum(row.delivered for row in self.rows) - missed + heard_alone,
            "host_lost": missed + unseen - heard_alone,
        }

    def dropped(self) -> int:
        """Frames that left a process and never reached the recorder."""
        return sum(max(r.get("sent", 0) - self.sent_by[name], 0) for name, r in self.finals.items())

    # --- the account of one frame ---------------------------------------------------------------------------------

    def _hearers(self, frame: Frame) -> Iterator[str]:
        src = self._processes.get(frame.src)
        cell = src.cell if src else ""
        asked = self._listeners if frame.broadcast else filter(None, [self._processes.get(frame.to)])
        return (p.id for p in asked if p.hears(frame.medium, frame.to, frame.src, cell))

    def _overflowed(self, frame: Frame) -> list[MessageRow]:
        said = describe(frame.payload, self._kind(frame.src))
        return [_row(frame, hearer, "overflow", None, said, None) for hearer in self._hearers(frame)]

    def _kind(self, id: str) -> Kind | None:
        """The kind of sensing of a process; None if it has no sensor, or is unknown."""
        if id not in self._kinds:
            sound = self._processes[id].sound if id in self._processes else {}
            self._kinds[id] = known_kind(sound["kind"], sound["options"]) if sound else None
        return self._kinds[id]

    def _local_ns(self, frame: Frame) -> int | None:
        """What its sender's clock showed as it left, where that is known."""
        diary = self.diaries.get(life_name(frame.src, frame.incarnation))
        return diary.local_ns(frame.sent_ns) if diary else None

    def _await(self, frame: Frame, row: MessageRow) -> None:
        self._order += 1
        heappush(self._pending, (row.due_ns or row.sent_ns, self._order, frame, row))

    def _judge(self, frame: Frame, row: MessageRow) -> MessageRow:
        self._note_clock(row)
        if row.due_ns is None:
            return row
        if row.due_ns >= self.run.end_ns:
            return replace(row, outcome="in_flight")
        owner = self._owner(row)
        if owner is None:
            return replace(row, outcome="dead")
        if (cause := owner.misses(frame.medium, row.due_ns)) is not None:
            return replace(row, outcome=cause)
        reason = owner.refused.get(frame.key(row.due_ns))
        if reason is None:
            return row
        return replace(row, outcome="late" if reason == LATE else "ignored")

    def _owner(self, row: MessageRow) -> Diary | None:
        """The life that owns a frame at its receiver."""
        return next((diary for diary in self._lives[row.dst] if diary.owns(row.due_ns or 0)), None)

    def _note_clock(self, row: MessageRow) -> None:
        """Note how far off the sender's clock was, except for messages that set clocks."""
        if row.src in self._timed and row.kind not in SYNCHRONISING:
            diary = self.diaries.get(life_name(row.src, row.incarnation))
            if diary is not None:
                self.clock_errors[row.sent_ns, row.src] = diary.clock_error_ns(row.sent_ns)

    def _bury(self, name: str) -> None:
        """A process that died unplanned got the first frames that it counted, and no more."""
        got, life = self.counts.get(name, {}).get("delivered", 0), self.diaries[name]
        mine = [i for i, r in enumerate(self.rows) if r.dst == life.spec.id and r.delivered and self._owner(r) is life]
        for i in sorted(mine, key=lambda i: self.rows[i].due_ns or 0)[got:]:
            self.rows[i] = replace(self.rows[i], outcome="dead")


class Said(NamedTuple):
    """The content of a payload: in words; of a report also its numbers, in the units of its kind, and its step."""

    text: str
    values: tuple[float, ...] = ()
    step: int | None = None


def _row(frame: Frame, hearer: str, outcome: str, due_ns: int | None, said: Said, local_ns: int | None) -> MessageRow:
    return MessageRow(
        frame.kind, frame.src, hearer, frame.medium, frame.sent_ns, due_ns, outcome, len(frame.payload), frame.copy,
        frame.incarnation, said.text, said.values, said.step, local_ns, frame.payload,
    )  # fmt: skip


@cache
def _own_kinds() -> tuple[Kind, ...]:
    """Trackfield's own kinds with messages of their own, which need no settings to be told in words."""
    kinds = (known_kind(name, {}) for name in SENSORS.own)
    return tuple(kind for kind in kinds if kind.message is not Measurement)


def describe(payload: bytes, kind: Kind | None = None) -> Said:
    """The content of a payload in words, if need be those of its sender's ``kind`` of sensing; never raises."""
    try:
        message = decode(payload)
    except WireError as error:
        return Said(f"malformed ({error.reason})")
    kind = next((one for one in (kind, *_own_kinds()) if one is not None and one.takes(message)), None)
    if kind is not None:
        try:
            return Said(kind.words(message), tuple(map(float, kind.values(message))), message.step)
        except Exception:  # noqa: BLE001  a user's own methods
            return Said(repr(message), step=message.step)
    match message:
        case Threshold(_, level_db):
            text = f"report from {level_db:.2f} dB on"
        case SyncRequest(exchange, sent_us):
            text = f"what time is it? (exchange {exchange}, here {sent_us / 1e6:.6f} s)"
        case SyncReply(exchange, left_us=left_us):
            text = f"it is {left_us / 1e6:.6f} s (exchange {exchange})"
        case Track(at_us, age_ms, tracker, sensors=sensors):
            of = f"tracker {tracker}, {len(sensors) // 2} reports, {age_ms / 1000:.3f} s old"
            text = f"the track at {at_us / 1e6:.3f} s ({of})"
        case _:
            return Said(repr(message), step=getattr(message, "step", None))
    return Said(text)
