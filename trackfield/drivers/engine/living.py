"""A process as it handles its events, one at a time: what they do to its life, and what it puts out."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from trackfield.drivers.engine import battery, radio
from trackfield.drivers.engine.conditions import At, Conditions, Sense
from trackfield.drivers.engine.frames import (
    LATE,
    RANK_BATTERY,
    RANK_FAULT,
    Arrival,
    Died,
    EventKey,
    Frame,
    Input,
    Output,
    PortInput,
    Refused,
    Sent,
    Told,
)
from trackfield.drivers.engine.life import Alarm, Life, without
from trackfield.drivers.engine.meter import Meter
from trackfield.drivers.engine.receiver import Windows
from trackfield.link.clock import Clock
from trackfield.role import (
    CancelTimer,
    Corrected,
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    Late,
    Listen,
    Note,
    PortRead,
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
    Tell,
    Timer,
    Write,
    formed,
)
from trackfield.wire.codec import WireError, decode, encode, kind_name
from trackfield.words import quoted


class Living:
    """A role under its ``conditions``, with its ``life`` so far."""

    __slots__ = ("_outputs", "conditions", "incarnation", "life", "owner", "role", "sense")

    def __init__(
        self, role: Role[Any], owner: str, clock: Clock, sense: Sense, conditions: Conditions, incarnation: int
    ) -> None:
        self.role, self.owner, self.sense, self.conditions = role, owner, sense, conditions
        self.incarnation = incarnation
        self.life = Life.new(role.begin(), clock, Meter.new(conditions.powers, conditions.start_ns))
        self._outputs: list[Output] = []

    @property
    def state(self) -> Any:
        """The role's state."""
        return self.life.state

    @property
    def tally(self) -> dict[str, int]:
        """The number of frames that were due here, by outcome."""
        return self.life.tally

    def live(self, key: EventKey, came: Input | None) -> list[Output]:
        """Handle the event of this key, with what came from outside; returns its outputs."""
        self._outputs = []
        self._handle(key, came)
        self.life, charge = battery.tell(self.life, self.conditions)
        if charge is not None:
            self._outputs.append(Told(key, charge))
        return self._outputs

    def own_key(self) -> EventKey | None:
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

    def _handle(self, key: EventKey, came: Input | None) -> None:
        t, life = key[0], self.life
        self.life = life = life._replace(meter=life.meter.at(t))
        if isinstance(came, PortInput):
            self._feed(PortRead(life.clock.local(t), came.port, came.data), key)
        elif came is not None:
            self._receive(came, key)
        elif key[1] in (RANK_FAULT, RANK_BATTERY):
            self._befall(key)
        else:
            name = key[3]
            alarm = life.alarms[name]
            self._keep_alarms(without(life.alarms, name))
            self._feed(Timer(alarm.at if alarm.fires_ns == alarm.due_ns else life.clock.local(t), name), key)

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
        from_ns = radio.hears_from(self.life, arrival)
        if from_ns is None:
            self._count("asleep")
            return
        self._count("delivered")
        self.life = radio.hear(self.life, arrival, from_ns, self.conditions)
        try:
            message = decode(frame.payload)
            if kind_name(message) != frame.kind:
                raise WireError("kind")
        except WireError as error:
            self._refuse(key, error.reason)
            return
        self._feed(Received(self.life.clock.local(t), message, frame.src, frame.medium), key)

    def _feed(self, event: Event, key: EventKey) -> None:
        state, effects = self.role.handle(self.life.state, event)
        self.life = self.life._replace(state=state)
        for effect in effects:
            self._do(effect, key, event.now)

    def _do(self, effect: Effect, key: EventKey, now: int) -> None:
        t: int = key[0]
        match effect:
            case Send():
                self._send(effect, key)
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
            case Listen():
                self._listen(effect, key)
            case Ignored() | Late():
                self._refuse(key, LATE if isinstance(effect, Late) else effect.reason)
            case Write():
                self._outputs.append(Told(key, effect))
            case Publish() | Store() | State() | Note() | Tell() | Corrected():
                self._tell(effect, key)
            case _:
                raise TypeError(f"{quoted(effect)} is no effect")

    def _tell(self, effect: Publish | Store | State | Note | Tell | Corrected, key: EventKey) -> None:
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
            self.life = self.life._replace(meter=self.life.meter.sensed())
        self._feed(Sampled(now, sensor, value), key)

    def _listen(self, effect: Listen, key: EventKey) -> None:
        """Begin to listen in windows; the recorder is told of them in true time."""
        clock = self.life.clock
        from_ns = clock.true(effect.from_ns)
        every_ns = clock.true(effect.from_ns + effect.every_ns) - from_ns
        windows = Windows(every_ns, effect.open_ns, from_ns, effect.detect_ns, effect.spare_ns)
        if not 0 < effect.open_ns <= every_ns or min(windows.detect_ns, windows.spare_ns) < 0:
            raise IllegalEvent(f"{effect} has no windows")
        self.life = radio.switch(self.life, windows, effect.medium, key[0])
        self._outputs.append(Told(key, Listen(*windows, effect.medium)))

    def _send(self, send: Send, key: EventKey) -> None:
        kind, payload, to = kind_name(send.message), encode(send.message), send.to
        for address in [to] if isinstance(to, str) else sorted(to):
            frame = Frame(
                self.owner, self.incarnation, kind, key[0], 0, address, send.medium, payload, send.preamble_ns
            )
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
