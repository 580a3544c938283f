"""The engine under both drivers: one role, its due events in total order, and the undoing of disorder.

A driver offers frames, asks for ``next_key`` and calls ``handle_next`` when that is due. Frames that arrive after an
event with a larger key was handled are put in their place by ``catch_up``: the state from before that event is
restored and everything since is handled again. What had left already is not sent a second time.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count
from typing import Any, NamedTuple

from trackfield.drivers.frames import (
    RANK_FAULT,
    RANK_TIMER,
    Arrival,
    EventKey,
    Frame,
    Output,
    Refused,
    Sent,
    Told,
    Undone,
    Wrote,
)
from trackfield.link.clock import Clock
from trackfield.role import (
    CancelTimer,
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    Late,
    Radio,
    Received,
    Role,
    Sample,
    Sampled,
    Send,
    SetTimer,
    Started,
    Timer,
    Write,
)
from trackfield.wire.codec import WireError, decode, encode, kind_name
from trackfield.wire.keys import Medium

Sense = Callable[[str, int], Any]
"""Reads the sensor of this name at a true time (ns)."""

LATE = "late"
"""The reason by which a role says that a frame came after its deadline."""


class Alarm(NamedTuple):
    """A pending timer: when it fires and was meant to fire (true time), and the local time it was set for."""

    fires_ns: int
    due_ns: int
    at: int


class Receiver(NamedTuple):
    """Whether a radio listens, since when, and whether it did before (a change at t counts after t)."""

    on: bool
    since_ns: int
    before: bool

    def at(self, t_ns: int) -> bool:
        """Whether a frame due at ``t_ns`` is heard."""
        return self.on if t_ns > self.since_ns else self.before


Copies = tuple[int, dict[tuple[str, str], int]]
"""The instant at which frames left last, and how many of each (kind, address)."""
Life = tuple[Any, dict[str, Alarm], dict[str, Receiver], Copies, dict[str, int]]
"""A snapshot: all of a process that changes by handling events. Nobody writes into its parts."""


@dataclass(slots=True)
class Handled:
    """One entry of the history: the event, the life before it, and what left because of it."""

    key: EventKey
    before: Life
    arrival: Arrival | None
    outputs: list[Output]


class Core:
    """One role and its events.

    ``horizon_ns`` is how far back (true time) events can be undone; 0: never, then all frames must come in order.
    ``tally`` counts the frames that were due here by what became of them; ``inversions`` the frames that had to be
    put in their place; ``host_late`` those that came when it could no longer be done without a trace.
    """

    def __init__(
        self,
        role: Role[Any],
        *,
        owner: str,
        clock: Clock,
        sense: Sense,
        start_ns: int = 0,
        incarnation: int = 0,
        horizon_ns: int = 0,
    ) -> None:
        self.role, self.owner, self.clock, self.sense = role, owner, clock, sense
        self.incarnation, self.horizon_ns = incarnation, horizon_ns
        self.inversions = self.host_late = 0
        self.state: Any = role.begin()
        self.tally: dict[str, int] = {}
        self._alarms: dict[str, Alarm] = {}
        self._receivers: dict[str, Receiver] = {}
        self._copies: Copies = (-1, {})
        self._started = False
        self._start_key: EventKey = (start_ns, RANK_FAULT, "start")
        self._arrivals: list[tuple[EventKey, int, Arrival]] = []
        self._offered = count()
        self._history: deque[Handled] = deque()
        self._inverted: list[Arrival] = []
        self._last: EventKey = (start_ns - 1,)
        self._forgotten: EventKey = self._last
        self._ghosts: set[tuple[Any, ...]] = set()
        self._outputs: list[Output] = []

    @property
    def _life(self) -> Life:
        return self.state, self._alarms, self._receivers, self._copies, self.tally

    @_life.setter
    def _life(self, life: Life) -> None:
        self.state, self._alarms, self._receivers, self._copies, self.tally = life

    def next_key(self) -> EventKey | None:
        """The key of the next event, or None."""
        if not self._started:
            return self._start_key
        frame = self._arrivals[0][0] if self._arrivals else None
        timer = self._next_alarm()
        if timer is None or (frame is not None and frame < timer):
            return frame
        return timer

    @property
    def behind(self) -> bool:
        """Whether ``catch_up`` has something to do."""
        return bool(self._inverted)

    def offer(self, arrival: Arrival) -> None:
        """Accept a frame due here; one that belongs before what was already handled waits for ``catch_up``."""
        key = arrival.key
        if key < self._last:
            self._inverted.append(arrival)
        else:
            self._push(arrival)

    def handle_next(self) -> list[Output]:
        """Handle the next event and return what leaves because of it."""
        outputs = self._step()
        return [o for o in outputs if not isinstance(o, Sent) or o.frame.identity not in self._ghosts]

    def catch_up(self) -> list[Output]:
        """Put the frames that came too late in their place; what leaves because of that.

        One that is older than what can be undone is put after all that was handled, and counted.
        """
        for arrival in self._inverted:
            if arrival.key < self._forgotten:
                self.host_late += 1
                self._push(Arrival(self._last[0] + 1, arrival.frame))
            else:
                self.inversions += 1
                self._push(arrival)
        self._inverted = []
        if self._arrivals and self._arrivals[0][0] < self._last:
            return self._replay(self._arrivals[0][0])
        return []

    def _push(self, arrival: Arrival) -> None:
        heappush(self._arrivals, (arrival.key, next(self._offered), arrival))

    # --- one event ---------------------------------------------------------------------------------------------

    def _step(self) -> list[Output]:
        key = self.next_key()
        if key is None:
            raise IllegalEvent("nothing is due")
        before, self._outputs = self._life, []
        arrival = self._handle(key)
        # A timer set for this very instant may have a smaller key than the one that set it.
        outputs, self._last = self._outputs, max(self._last, key)
        self._history.append(Handled(key, before, arrival, outputs))
        while self._history and self._history[0].key[0] <= key[0] - self.horizon_ns:
            self._forgotten = self._history.popleft().key
        return outputs

    def _next_alarm(self) -> EventKey | None:
        alarms = self._alarms
        if not alarms:
            return None
        return min((a.fires_ns, RANK_TIMER, a.due_ns, name) for name, a in alarms.items())

    def _handle(self, key: EventKey) -> Arrival | None:
        t = key[0]
        if key[1] == RANK_FAULT:
            self._started = True
            self._feed(Started(self.clock.local(t)), key)
            return None
        if key[1] == RANK_TIMER:
            name = key[3]
            alarm = self._alarms[name]
            self._alarms = _without(self._alarms, name)
            self._feed(Timer(alarm.at if alarm.fires_ns == alarm.due_ns else self.clock.local(t), name), key)
            return None
        arrival = heappop(self._arrivals)[2]
        self._receive(arrival.frame, key)
        return arrival

    def _receive(self, frame: Frame, key: EventKey) -> None:
        receiver = self._receivers.get(frame.medium)
        if receiver is not None and not receiver.at(key[0]):
            self._count("asleep")
            return
        self._count("delivered")
        try:
            message = decode(frame.payload)
            if kind_name(message) != frame.kind:
                raise WireError("kind")
        except WireError as error:
            self._refuse(key, error.reason)
            return
        self._feed(Received(self.clock.local(key[0]), message, frame.src), key)

    def _feed(self, event: Event, key: EventKey) -> None:
        self.state, effects = self.role.handle(self.state, event)
        for effect in effects:
            self._do(effect, key, event.now)

    def _do(self, effect: Effect, key: EventKey, now: int) -> None:
        t: int = key[0]
        match effect:
            case Send(message, to, medium):
                self._send(message, to, medium, key)
            case SetTimer(name, at):
                due = self.clock.true(at)
                self._alarms = {**self._alarms, name: Alarm(max(due, t), due, at)}
            case CancelTimer(name):
                self._alarms = _without(self._alarms, name)
            case Sample(sensor):
                self._feed(Sampled(now, sensor, self.sense(sensor, t)), key)
            case Radio(on, medium):
                self._switch(on, medium, t)
                self._outputs.append(Told(key, effect))
            case Ignored(reason):
                self._refuse(key, reason)
            case Late():
                self._refuse(key, LATE)
            case Write(port, data):
                self._outputs.append(Wrote(key, port, data))
            case _:
                self._outputs.append(Told(key, effect))

    def _send(self, message: Any, to: str | frozenset[str], medium: Medium, key: EventKey) -> None:
        t, kind = key[0], kind_name(message)
        addresses = [to] if isinstance(to, str) else sorted(to)
        if not addresses:
            return
        since, counts = self._copies
        counts = counts if since == t else {}
        copy = max(counts.get((kind, address), 0) for address in addresses)
        self._copies = (t, {**counts, **{(kind, address): copy + 1 for address in addresses}})
        frame = Frame(self.owner, self.incarnation, kind, t, copy, ",".join(addresses), medium, encode(message))
        self._outputs.append(Sent(key, frame))

    def _switch(self, on: bool, medium: Medium, t: int) -> None:
        old = self._receivers.get(medium, Receiver(True, -1, True))
        new = Receiver(on, t, old.before if old.since_ns == t else old.on)
        self._receivers = {**self._receivers, medium: new}

    def _refuse(self, key: EventKey, reason: str) -> None:
        self._count(LATE if reason == LATE else "ignored")
        self._outputs.append(Refused(key, reason))

    def _count(self, outcome: str) -> None:
        self.tally = {**self.tally, outcome: self.tally.get(outcome, 0) + 1}

    # --- putting a frame in its place -----------------------------------------------------------------------------

    def _replay(self, since: EventKey) -> list[Output]:
        """Undo every event from ``since`` on, and handle all that is due up to where we were."""
        undone: list[Handled] = []
        while self._history and self._history[-1].key > since:
            undone.append(self._history.pop())
        undone.reverse()
        if undone:  # else all that came after it vanished in an earlier replay
            self._life = undone[0].before
        for handled in undone:
            if handled.arrival is not None:
                self._push(handled.arrival)
        new: list[Output] = []
        while (key := self.next_key()) is not None and key <= self._last:
            new += self._step()
        return self._difference([o for h in undone for o in h.outputs], new, since)

    def _difference(self, old: list[Output], new: list[Output], since: EventKey) -> list[Output]:
        """What must leave after a replay: frames that are new, and telemetry again if it changed."""
        left, again = _frames(old), _frames(new)
        vanished = [f for f in left if f not in again]
        self.host_late += bool(vanished)
        self._ghosts.update(f.identity for f in vanished)
        known = {f.identity for f in left} | self._ghosts
        out: list[Output] = [o for o in new if isinstance(o, Sent) and o.frame.identity not in known]
        told, retold = ([o for o in side if isinstance(o, Told | Refused)] for side in (old, new))
        if told != retold:
            out += [Undone(since), *retold]
        return out


def _without(alarms: dict[str, Alarm], name: str) -> dict[str, Alarm]:
    return {n: a for n, a in alarms.items() if n != name}


def _frames(outputs: Iterable[Output]) -> list[Frame]:
    return [o.frame for o in outputs if isinstance(o, Sent)]
