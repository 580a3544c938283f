"""The engine of both drivers: one role, its due events in total order, and replay of events that came out of order.

A driver offers frames, asks for ``next_key`` and calls ``handle_next`` when that is due. Frames that arrive after an
event with a larger key was handled are inserted by ``catch_up``: the state before that event is restored and
everything since is handled again. Frames that had already left are not sent a second time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from heapq import heappop, heappush
from itertools import count
from typing import Any

from trackfield.drivers import battery, radio
from trackfield.drivers.conditions import At, Conditions, Sense
from trackfield.drivers.frames import (
    LATE,
    RANK_BATTERY,
    RANK_FAULT,
    RANK_TIMER,
    Arrival,
    Died,
    EventKey,
    Frame,
    Output,
    Refused,
    Sent,
    Told,
)
from trackfield.drivers.life import Alarm, Handled, Life, without
from trackfield.drivers.meter import NOTHING, Activity
from trackfield.drivers.undo import History, difference
from trackfield.link.clock import Clock
from trackfield.role import (
    CancelTimer,
    Corrected,
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    Late,
    Note,
    Publish,
    Radio,
    Received,
    Role,
    Sample,
    Sampled,
    Send,
    SetTimer,
    Started,
    State,
    Store,
    Timer,
    Write,
    formed,
)
from trackfield.wire.codec import WireError, decode, encode, kind_name
from trackfield.wire.keys import Medium
from trackfield.words import quoted


class Core:
    """One role and its events.

    ``horizon_ns`` is how far back (true time) events can be undone; 0: never, then all frames must come in order.
    ``inversions`` counts the frames that had to be inserted; ``host_late`` those that came when the effects could no
    longer be undone. A driver that holds frames back for a while says by ``recall`` whether a frame could still be
    withdrawn.
    """

    def __init__(
        self,
        role: Role[Any],
        *,
        owner: str,
        clock: Clock,
        sense: Sense,
        conditions: Conditions = Conditions(),  # noqa: B008  a frozen value
        incarnation: int = 0,
        horizon_ns: int = 0,
    ) -> None:
        self.role, self.owner, self.sense, self.conditions = role, owner, sense, conditions
        self.incarnation, self.horizon_ns = incarnation, horizon_ns
        self.inversions = self.host_late = 0
        self.life = Life.new(role.begin(), clock, conditions.start_ns)
        self._arrivals: list[tuple[EventKey, int, Arrival]] = []
        self._offered = count()
        self._inverted: list[Arrival] = []
        self._last: EventKey = (conditions.start_ns - 1,)
        self._history = History(self._last)
        self._ghosts: set[tuple[Any, ...]] = set()
        self._outputs: list[Output] = []
        self.recall: Callable[[Frame], bool] = lambda frame: False
        self._inherited = NOTHING

    @property
    def state(self) -> Any:
        """The role's state."""
        return self.life.state

    @property
    def tally(self) -> dict[str, int]:
        """The number of frames that were due here, by outcome."""
        return self.life.tally

    def next_key(self) -> EventKey | None:
        """The key of the next event, or None."""
        life = self.life
        if life.over:
            return None
        key = self._own_key()
        if life.started:
            if self._arrivals and (key is None or self._arrivals[0][0] < key):
                key = self._arrivals[0][0]
            alarms = life.alarms
            if alarms:
                timer = min((a.fires_ns, RANK_TIMER, a.due_ns, name) for name, a in alarms.items())
                key = timer if key is None else min(timer, key)
        return key if key is None or key[0] < self.conditions.kill_ns else None

    @property
    def behind(self) -> bool:
        """Whether ``catch_up`` has something to do."""
        return bool(self._inverted)

    def owns(self, due_ns: int) -> bool:
        """Whether a frame due then belongs to this life."""
        return self.conditions.start_ns <= due_ns < self.conditions.kill_ns

    def offer(self, arrival: Arrival) -> None:
        """Accept a frame due here; a frame that belongs before handled events waits for ``catch_up``."""
        key = arrival.key
        if key < self._last:
            self._inverted.append(arrival)
        else:
            self._push(arrival)

    def handle_next(self) -> list[Output]:
        """Handle the next event and return its outputs."""
        outputs = self._step()
        return [o for o in outputs if not isinstance(o, Sent) or o.frame.identity not in self._ghosts]

    def catch_up(self) -> list[Output]:
        """Insert the frames that came out of order; returns the resulting outputs.

        A frame older than the events that can be undone is handled after all others, and counted.
        """
        for arrival in self._inverted:
            if arrival.key < self._history.forgotten:
                self.host_late += 1
                self._push(replace(arrival, due_ns=self._last[0] + 1))
            else:
                self.inversions += 1
                self._push(arrival)
        self._inverted = []
        if self._arrivals and self._arrivals[0][0] < self._last:
            return self._replay(self._arrivals[0][0])
        return []

    def inherit(self, stored: bytes, activity: Activity = NOTHING) -> None:
        """Take over what an earlier life stored and its use of the battery; to be called before this life starts."""
        meter = self.life.meter._replace(activity=activity)
        self.life, self._inherited = self.life._replace(stored=stored, meter=meter), activity

    def record(self, until_ns: int) -> dict[str, Any]:
        """The counters of this life, up to a true time or its own end."""
        life = self.life
        end = max(min(until_ns, self.conditions.kill_ns), life.meter.since_ns)
        meter = life.meter if life.over or not life.started else life.meter.at(end)
        return {
            **life.tally,
            "incarnation": self.incarnation,
            "stored": life.stored,
            "inversions": self.inversions,
            "host_late": self.host_late,
            "activity": [a - b for a, b in zip(meter.activity, self._inherited, strict=True)],
            "inherited": list(self._inherited),
            "metered_ns": meter.since_ns - self.conditions.start_ns,
        }

    def _push(self, arrival: Arrival) -> None:
        heappush(self._arrivals, (arrival.key, next(self._offered), arrival))

    # --- one event ---------------------------------------------------------------------------------------------

    def _step(self) -> list[Output]:
        key = self.next_key()
        if key is None:
            raise IllegalEvent("nothing is due")
        before, self._outputs = self.life, []
        arrival = self._handle(key)
        self.life, charge = battery.tell(self.life, self.conditions)
        if charge is not None:
            self._outputs.append(Told(key, charge))
        # A timer set for this same instant may have a smaller key than the event that set it.
        outputs, self._last = self._outputs, max(self._last, key)
        self._history.add(Handled(key, before, arrival, outputs), key[0] - self.horizon_ns)
        return outputs

    def _own_key(self) -> EventKey | None:
        """The key of the next event that does not depend on the role or on other processes."""
        life, given = self.life, self.conditions
        if not life.started:
            return given.start_ns, RANK_FAULT, "start"
        key: EventKey | None = None
        if life.jumped < len(given.jumps):
            key = (given.jumps[life.jumped][0], RANK_FAULT, "clock")
        falls_ns = battery.falls_ns(life, given)
        if falls_ns is not None and (key is None or falls_ns < key[0]):
            key = (falls_ns, RANK_BATTERY)
        return key

    def _handle(self, key: EventKey) -> Arrival | None:
        t, life = key[0], self.life
        self.life = life = life._replace(meter=life.meter.at(t))
        if key[1] in (RANK_FAULT, RANK_BATTERY):
            self._befall(key)
            return None
        if key[1] == RANK_TIMER:
            name = key[3]
            alarm = life.alarms[name]
            self._keep_alarms(without(life.alarms, name))
            self._feed(Timer(alarm.at if alarm.fires_ns == alarm.due_ns else life.clock.local(t), name), key)
            return None
        arrival = heappop(self._arrivals)[2]
        self._receive(arrival, key)
        return arrival

    def _befall(self, key: EventKey) -> None:
        """A start, a jump of the clock, or a fall of the battery's charge; with an empty battery nothing starts."""
        t, starting = key[0], not self.life.started
        self.life = life = self.life._replace(started=True)
        if (starting or key[1] == RANK_BATTERY) and battery.empty(life, self.conditions):
            self.life = life._replace(over=True)
            self._outputs.append(Told(key, Died("battery")))
        elif starting:
            self._feed(Started(life.clock.local(t), life.stored), key)
        elif key[1] == RANK_FAULT:
            # Pending timers are unchanged: they fire when they would have, and the clock then shows another time.
            by = self.conditions.jumps[life.jumped][1]
            alarms = {name: alarm._replace(at=alarm.at + by) for name, alarm in life.alarms.items()}
            self.life = life._replace(clock=life.clock.jumped(by), alarms=alarms, jumped=life.jumped + 1)

    def _receive(self, arrival: Arrival, key: EventKey) -> None:
        t, frame = key[0], arrival.frame
        if self.conditions.thaw_ns(t) != t:
            self._count("frozen")
            return
        if not radio.listens(self.life, frame.medium, t):
            self._count("asleep")
            return
        self._count("delivered")
        self.life = radio.hear(self.life, arrival, self.conditions)
        try:
            message = decode(frame.payload)
            if kind_name(message) != frame.kind:
                raise WireError("kind")
        except WireError as error:
            self._refuse(key, error.reason)
            return
        self._feed(Received(self.life.clock.local(t), message, frame.src), key)

    def _feed(self, event: Event, key: EventKey) -> None:
        state, effects = self.role.handle(self.life.state, event)
        self.life = self.life._replace(state=state)
        for effect in effects:
            self._do(effect, key, event.now)

    def _do(self, effect: Effect, key: EventKey, now: int) -> None:
        t: int = key[0]
        match effect:
            case Send(message, to, medium):
                self._send(message, to, medium, key)
            case SetTimer(name, at):
                due = self.life.clock.true(at)
                alarm = Alarm(self.conditions.thaw_ns(max(due, t)), due, at)
                self._keep_alarms({**self.life.alarms, name: alarm})
            case CancelTimer(name):
                self._keep_alarms(without(self.life.alarms, name))
            case Sample(sensor):
                self._sample(sensor, key, now)
            case Radio(on, medium):
                self.life = radio.switch(self.life, on, medium, t)
                self._outputs.append(Told(key, effect))
            case Ignored() | Late():
                self._refuse(key, LATE if isinstance(effect, Late) else effect.reason)
            case Write():
                self._outputs.append(Told(key, effect))
            case Publish() | Store() | State() | Note() | Corrected():
                self._tell(effect, key)
            case _:
                raise TypeError(f"{quoted(effect)} is no effect")

    def _tell(self, effect: Publish | Store | State | Note | Corrected, key: EventKey) -> None:
        if isinstance(effect, Store):
            self.life = self.life._replace(stored=effect.data)
        elif isinstance(effect, Publish):
            effect = Publish(replace(formed(effect.estimate), source=self.owner))
        self._outputs.append(Told(key, effect))

    def _keep_alarms(self, alarms: dict[str, Alarm]) -> None:
        self.life = self.life._replace(alarms=alarms)

    def _sample(self, sensor: str, key: EventKey, now: int) -> None:
        value = self.sense(sensor, key[0])
        if isinstance(value, At):
            value = None if value.true_ns is None else self.life.clock.local(value.true_ns)
        else:
            self.life = self.life._replace(meter=self.life.meter.used(samples=1))
        self._feed(Sampled(now, sensor, value), key)

    def _send(self, message: Any, to: str | frozenset[str], medium: Medium, key: EventKey) -> None:
        kind, payload = kind_name(message), encode(message)
        for address in [to] if isinstance(to, str) else sorted(to):
            frame = Frame(self.owner, self.incarnation, kind, key[0], 0, address, medium, payload)
            self.life, leaving, news = radio.send(self.life, frame, self.conditions)
            if news is not None:
                self._outputs.append(Told(key, news))
            if leaving is not None:
                self._outputs.append(Sent(key, leaving))

    def _refuse(self, key: EventKey, reason: str) -> None:
        self._count(LATE if reason == LATE else "ignored")
        self._outputs.append(Refused(key, reason))

    def _count(self, outcome: str) -> None:
        tally = self.life.tally
        self.life = self.life._replace(tally={**tally, outcome: tally.get(outcome, 0) + 1})

    # --- inserting a frame -----------------------------------------------------------------------------

    def _replay(self, since: EventKey) -> list[Output]:
        """Undo every event from ``since`` on, and handle all that is due up to the present position."""
        undone = self._history.since(since)
        if undone:  # else all events after it disappeared in an earlier replay
            self.life = undone[0].before
        for handled in undone:
            if handled.arrival is not None:
                self._push(handled.arrival)
        new: list[Output] = []
        while (key := self.next_key()) is not None and key <= self._last:
            new += self._step()
        old = [o for h in undone for o in h.outputs]
        out, mistaken = difference(old, new, since, self._ghosts, self.recall)
        self.host_late += mistaken
        return out
