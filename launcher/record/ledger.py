"""The ledger: every frame accounted for.

As the fate of a frame is a pure function, the ledger computes what became of each frame at each receiver from the frame
alone; what depends on the receiver's state (asleep, refused as late) it takes from the receiver's telemetry, and the
receivers' own counters are the cross-check. Its input are ``sent``, ``told`` and ``final``, from Zenoh or from the
virtual driver alike. Of each frame the highest version holds, in whatever order they come; all accounts are made when a
frame is settled, so one that was taken back before leaves no trace.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from heapq import heappop, heappush
from itertools import count
from typing import Any, Final, NamedTuple

from launcher.record.books.balance import Balance
from launcher.record.books.leaving import Entry, Leaving, Way
from launcher.record.books.said import Said, describe, row_of
from launcher.record.diary import Diary, Event
from launcher.records import MessageRow
from trackfield.drivers.engine.frames import LATE, Died, Frame, Identity, Overflowed, Refused, Told, Undone
from trackfield.drivers.exchange.versions import hash_of
from trackfield.drivers.spec import ProcessSpec, RunSpec, life_name, link_of
from trackfield.link.fate import Transmission
from trackfield.role import Publish, TrackPoint
from trackfield.sensing.complete import Kind
from trackfield.sensing.kinds import known_kind
from trackfield.wire.error import WireError
from trackfield.wire.keys import id_of

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


class Sending(NamedTuple):
    """A frame that left at ``sent_ns``: by whom, of which kind, on which medium, and how long it was, in bytes.

    ``on_air`` counts headers, fragments and repeats too; 0 without a radio.
    """

    sent_ns: int
    src: str
    kind: str
    medium: str
    size: int
    on_air: int


Arriving = tuple[int, Identity, str, int, Way, Frame, Said, int | None, int]
"""A frame at one of its hearers: when (ns) it is settled what became of it, the order of such, and what is known."""


class Ledger:
    """The frames of one run; ``rows`` grows as outcomes settle.

    ``corrected`` counts the frames to each place that were taken back or replaced, and ``foreign`` are the places that
    send frames without versions; ``aired`` are the frames by radio, ``sendings`` all. What a ``provisional`` ledger has
    handed on can still be undone. What is lost at the ids that are ``cut_off`` for a while, as the faults of their
    containers are planned, is not lost by the machine.
    """

    def __init__(
        self,
        run: RunSpec,
        processes: Sequence[ProcessSpec],
        *,
        provisional: bool = False,
        cut_off: Collection[str] = (),
    ) -> None:
        self.run = run
        self.rows: list[MessageRow] = []
        self.corrected: Counter[str] = Counter()
        self.foreign: set[str] = set()
        self.sent_kinds: Counter[str] = Counter()
        self.payload_max: Counter[str] = Counter()
        self.payload_bytes = 0
        self.on_air = 0
        self.aired: list[Transmission] = []
        self.sendings: list[Sending] = []
        self.sent_bytes: defaultdict[str, tuple[int, int]] = defaultdict(lambda: (0, 0))
        self.finals: dict[str, dict[str, Any]] = {}
        self.counts: dict[str, dict[str, int]] = {}
        self.diaries = {p.name: Diary(p) for p in processes}
        self.clock_errors: dict[tuple[int, str], int] = {}
        self.refused: Counter[str] = Counter()
        self.balance = Balance()
        self.link = link_of(run, processes)
        self._provisional = provisional
        self._cut_off = frozenset(cut_off)
        self._interfered: Counter[str] = Counter()
        self._processes = {p.id: p for p in processes}
        self._lives: defaultdict[str, list[Diary]] = defaultdict(list)
        for p in processes:
            self._lives[p.id].append(self.diaries[p.name])
        self.leaving = Leaving(self._processes, self.link, run.end_ns)
        self._kinds: dict[str, Kind | None] = {}
        self._timed = {p.id for p in processes if p.clock or p.jumps}
        self._written: dict[str, None] = {}
        self._kills = sorted((p.kill_ns, p.name) for p in processes if p.kill_ns is not None)
        self._ended: set[str] = set()
        self._arriving: list[Arriving] = []
        self._order = count()

    # --- what is seen ---------------------------------------------------------------------------------------------

    @property
    def sent_by(self) -> Counter[str]:
        """How many frames each life sent, of those that are settled."""
        return Counter({name: live.digest.size for name, live in self.balance.live.items()})

    def sent(self, frame: Frame, version: int | None = 0) -> None:
        """A version of a frame left (None: it is final); without a payload it says that the frame was taken back."""
        if self.leaving.too_late(frame, version):
            self.balance.late[life_name(frame.src, frame.incarnation)] += 1
            return
        for way in self.leaving.put(frame, version):
            if way.hearer in self._ended:
                self._note_tardy(way)

    def told(self, process: str, output: Told | Refused | Undone) -> None:
        """Telemetry of a process."""
        self.diaries[process].write(output, -1 if self._provisional else self.leaving.settled_ns)
        self._written[process] = None
        self.balance.told[process] += 1

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
        self.leaving.end_ns = self.run.end_ns

    def final(self, process: str, record: Mapping[str, Any]) -> None:
        """The final record of a process; another one of the same life is not from it."""
        self._interfered[TELEMETRY] += self.finals.get(process, record) != record
        self.finals[process] = dict(record)
        self._ended.add(id_of(process))
        if "retractions" not in record:
            self.foreign.add(id_of(process))

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
        return {
            FRAMES: self._interfered[FRAMES] + self.balance.strange_frames(self.finals),
            TELEMETRY: self._interfered[TELEMETRY] + self.balance.strange_telemetry(self.finals),
            ANSWERS: sum(record.get("forged", 0) for record in self.finals.values()),
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
        arrived: list[Arriving] = []
        for entry in self.leaving.settle(until_ns):
            for one in self._account(entry):
                if one[0] <= until_ns:
                    arrived.append(one)
                else:
                    heappush(self._arriving, one)
        while self._arriving and self._arriving[0][0] <= until_ns:
            arrived.append(heappop(self._arriving))
        rows = [self._judged(*one[4:]) for one in sorted(arrived)]
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

    def unsettled(self, until_ns: int) -> list[Event]:
        """What processes reported up to this true time and was not returned by ``settle``, in time order."""
        events = [
            Event(kill_ns, id_of(name), Died("killed"))
            for kill_ns, name in self._kills
            if kill_ns <= until_ns and self.diaries[name].died is None
        ]
        for name in self._written:
            events += self.diaries[name].waiting()
        return sorted((event for event in events if event.t_ns <= until_ns), key=lambda event: event.t_ns)

    def close(self, dead: Iterable[str] = ()) -> tuple[list[MessageRow], list[Event]]:
        """Settle all; ``dead`` names lives that ended unplanned, which got only what they had counted."""
        arriving = (one[0] for one in self._arriving)
        rows, events = self.settle(max(self.run.end_ns, self.leaving.last_ns(), *arriving))
        for name in set(dead) & self.diaries.keys():
            self._bury(name)
        return rows, events

    def sums(self) -> dict[str, int]:
        """How many frames were ``expected``, ``delivered``, ``host_lost`` and ``host_late``.

        The machine lost a frame that the recorder saw and a receiver did not get, and one that neither of them saw. A
        frame that only the recorder missed was delivered. Word that a frame was taken back, which its receiver never
        got, was expected and lost as well.
        """
        missed, unseen = self.balance.missed(self.finals), self.balance.unseen(self.finals)
        heard_alone = min(missed.more, unseen)
        unheeded = missed.more - heard_alone
        arrived = sum(row.delivered for row in self.rows)
        return {
            "expected": len(self.rows) + unseen + unheeded,
            "delivered": arrived + heard_alone - missed.lost - missed.late,
            "host_lost": missed.lost + unseen - heard_alone + unheeded,
            "host_late": missed.late,
        }

    def lost_by_containers(self) -> int:
        """How many of the frames that are ``host_lost`` were for or from those that were cut off, as planned."""
        away = self._of_cut_off()
        return min(self.balance.missed(away).lost + self.balance.unseen(away), self.sums()["host_lost"])

    def tardy(self) -> int:
        """What came too late without its hearer's knowledge: after its last word, or when it was recorded for good."""
        uncounted, undone = self.balance.missed(self.finals).uncounted, sum(d.late for d in self.diaries.values())
        return uncounted + self.balance.late.total() + undone

    def dropped(self) -> int:
        """Puts that left a process and never reached the recorder: frames, or word that one was taken back."""
        return self.balance.dropped(self.finals) - self.balance.dropped(self._of_cut_off())

    def complaints(self) -> list[str]:
        """What is wrong with the record by the counts of those who are recorded, a sentence each."""
        untold = self.balance.untold(self.finals) - self.balance.untold(self._of_cut_off())
        late = sum(times for name, times in self.balance.late.items() if id_of(name) not in self._cut_off)
        undone = sum(diary.late for diary in self.diaries.values() if diary.spec.id not in self._cut_off)
        found = {
            f"{untold} pieces of telemetry never reached the recorder: states or tracks may be missing": untold,
            f"{late} frames were taken back or replaced when they were recorded for good": late,
            f"{undone} times telemetry was taken back when it was recorded for good": undone,
        }
        return [sentence for sentence, times in found.items() if times]

    def _of_cut_off(self) -> dict[str, dict[str, Any]]:
        """The final records of those that were cut off for a while, as planned."""
        return {name: record for name, record in self.finals.items() if id_of(name) in self._cut_off}

    # --- the account of one frame ---------------------------------------------------------------------------------

    def _overflowed(self, frame: Frame) -> list[MessageRow]:
        said = describe(frame.payload, self._kind(frame.src))
        return [row_of(frame, hearer, "overflow", None, said, None) for hearer in self.leaving.hearers(frame)]

    def _kind(self, id: str) -> Kind | None:
        """The kind of sensing of a process; None if it has no sensor, or is unknown."""
        if id not in self._kinds:
            sound = self._processes[id].sound if id in self._processes else {}
            recorded = sound.get("recorded", False)
            self._kinds[id] = known_kind(sound["kind"], sound["options"], recorded=recorded) if sound else None
        return self._kinds[id]

    def _note_tardy(self, way: Way) -> None:
        """Count a put for a life that has said its last word."""
        if way.due_ns is not None and way.due_ns < self.run.end_ns:
            owner = self._owner(way.hearer, way.due_ns)
            if owner is not None and owner.spec.name in self.finals:
                self.balance.tardy[owner.spec.name] += 1

    def _account(self, entry: Entry) -> list[Arriving]:
        """Enter what is left of a frame; what becomes of it at its hearers depends on their telemetry until then."""
        identity, frame, version, cost, ways = entry
        life = life_name(frame.src, frame.incarnation)
        self.balance.puts[life] += (version or 0) + 1
        if version:
            self.corrected.update(self.leaving.hearers(frame))
        if cost is None:
            return []
        hashed = hash_of(frame, version)
        self.balance.live[life].add(hashed)
        self.sent_kinds[frame.kind] += 1
        self.payload_bytes += len(frame.payload)
        self.payload_max[frame.kind] = max(self.payload_max[frame.kind], len(frame.payload))
        self.on_air += cost.bytes_on_air
        self.sendings.append(
            Sending(frame.sent_ns, frame.src, frame.kind, frame.medium, len(frame.payload), cost.bytes_on_air)
        )
        if cost.busy_ns or frame.preamble_ns:
            self.aired.append(frame.transmission(frame.to))
        size, frames = self.sent_bytes[frame.src]
        self.sent_bytes[frame.src] = size + len(frame.payload), frames + 1
        if not ways:
            return []
        diary = self.diaries.get(life)
        if diary is not None:
            self._note_clock(frame, diary)
        local_ns = None if diary is None else diary.local_ns(frame.sent_ns)
        order, what = self._order, (frame, describe(frame.payload, self._kind(frame.src)), local_ns, hashed)
        return [
            (frame.sent_ns if way.due_ns is None else way.due_ns, identity, way.hearer, next(order), way, *what)
            for way in ways
        ]

    def _judged(self, way: Way, frame: Frame, said: Said, local_ns: int | None, hashed: int) -> MessageRow:
        """The outcome of a frame at a hearer."""
        self.leaving.ways[way.outcome] -= 1
        outcome = way.outcome if way.due_ns is None else self._outcome(frame, way, way.due_ns, hashed)
        return row_of(frame, way.hearer, outcome, way.due_ns, said, local_ns)

    def _outcome(self, frame: Frame, way: Way, due_ns: int, hashed: int) -> str:
        if due_ns >= self.run.end_ns:
            return "in_flight"
        owner = self._owner(way.hearer, due_ns)
        if owner is None:
            return "dead"
        self.balance.due[owner.spec.name].add(hashed)
        if (cause := owner.misses(frame.medium, due_ns, way.span_ns, frame.preamble_ns)) is not None:
            return cause
        reason = owner.refused.get(frame.key(due_ns)) if owner.refused else None
        return "delivered" if reason is None else "late" if reason == LATE else "ignored"

    def _owner(self, hearer: str, due_ns: int) -> Diary | None:
        """The life that owns a frame at its receiver."""
        for diary in self._lives[hearer]:
            if diary.owns(due_ns):
                return diary
        return None

    def _note_clock(self, frame: Frame, diary: Diary) -> None:
        """Note how far off the sender's clock was, except for messages that set clocks."""
        if frame.src in self._timed and frame.kind not in SYNCHRONISING:
            self.clock_errors[frame.sent_ns, frame.src] = diary.clock_error_ns(frame.sent_ns)

    def _bury(self, name: str) -> None:
        """A process that died unplanned got the first frames that it counted, and no more."""
        got, life = self.counts.get(name, {}).get("delivered", 0), self.diaries[name]
        theirs = [(i, r) for i, r in enumerate(self.rows) if r.dst == life.spec.id and r.delivered]
        mine = [i for i, row in theirs if self._owner(row.dst, row.due_ns or 0) is life]
        for i in sorted(mine, key=lambda i: self.rows[i].due_ns or 0)[got:]:
            self.rows[i] = replace(self.rows[i], outcome="dead")
