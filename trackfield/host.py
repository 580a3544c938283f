"""A role made of roles, for a process with several functions, such as a node that may become a cluster head.

A process has one address, one radio and one set of sensors, however many roles it hosts. Therefore the host

- gives a frame to every role that consumes its kind, in order; it is ignored only if all of them ignore it, and late
  only if all that use it do so after its deadline; each role's own count is in ``Hosted.counts``;
- puts the role's name before its timers, ports and lanes (``node/step``), and takes it off again;
- keeps the receiver of a medium on while any role wants it on (at first all do), or if several want to listen in
  different windows (``Listen``); if one alone wants to listen, in windows, it does so;
- hands a message to the process's own id to the other roles that consume its kind: at the same instant, after all
  other effects of the current event, and whether or not the radio is on. It is still encoded and decoded, so that its
  receiver sees the same numbers as a distant one would. From a set of ids only the own one is removed. A message that
  no other role consumes is sent like any other. A broadcast is never handed over: a radio does not hear itself;
- keeps what each role stores, and gives each of them its own at the start of the next life;
- hands a correction of the clock (``Corrected``) to the other roles that follow it, as ``ClockSet``, when and in the
  order in which it would hand over a message. The driver is told of it once.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

import msgpack

from trackfield.role import (
    CancelTimer,
    ClockSet,
    Corrected,
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    Late,
    Listen,
    Note,
    PortRead,
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
)
from trackfield.wire.codec import decode, encode, kind_name
from trackfield.wire.keys import Medium, check_id

MAX_HANDED: Final = 1000
"""The most messages handed over because of one event; more mean that the roles send in an endless loop."""


Wish = Radio | Listen
"""How a role wants a receiver to listen."""
Work = tuple[str, Effect | Received | ClockSet]
"""An effect that this role asked for, or an event between the roles that it is to handle."""
Counts = tuple[int, int]
"""Frames that were delivered to a role, and of these the ones that it ignored."""


@dataclass(frozen=True, slots=True)
class Hosted:
    """The states of the roles, and how they want the receiver of a medium to listen, by role and medium.

    While a sensor is read: the role that asked, the sensor, and the ``work`` that waits for the answer. ``stored`` is
    what each role stored last, in this life or an earlier one; ``counts`` are the frames of this life, by role.
    """

    states: Mapping[str, Any]
    receivers: Mapping[tuple[str, Medium], Wish] = field(default_factory=dict)
    asked: tuple[str, str] | None = None
    work: tuple[Work, ...] = ()
    stored: Mapping[str, bytes] = field(default_factory=dict)
    counts: Mapping[str, Counts] = field(default_factory=dict)


def counts_of(state: Hosted) -> dict[str, dict[str, int]]:
    """The frames of a life by role: how many were ``delivered`` to it, and how many of these it ``ignored``."""
    return {name: dict(zip(("delivered", "ignored"), counts, strict=True)) for name, counts in state.counts.items()}


class Host:
    """The roles of the process ``id``, by name; raises ``WireError`` for an invalid name or id."""

    def __init__(self, roles: Mapping[str, Role[Any]], *, id: str) -> None:
        self.id, self.roles = check_id(id), {check_id(name): role for name, role in roles.items()}
        self.kinds = frozenset(kind for role in roles.values() for kind in role.kinds)
        self.followers = [name for name, role in roles.items() if getattr(role, "follows", False)]

    @property
    def follows(self) -> bool:
        """Whether any of its roles follows the clock, so that a host of this one hands it ``ClockSet``."""
        return bool(self.followers)

    def begin(self) -> Hosted:
        """Every role's state before ``Started``."""
        return Hosted({name: role.begin() for name, role in self.roles.items()})

    def handle(self, state: Hosted, event: Event) -> tuple[Hosted, tuple[Effect, ...]]:
        """See ``trackfield.role.Role``; a ``Sample`` is always the last effect, so that its answer follows at once.

        Raises ``IllegalEvent`` for a timer or port of no role, for any event but the answer of a sensor that is being
        read, and if the roles never stop handing messages to each other.
        """
        asked = state.asked[1] if state.asked else None
        if asked != (event.sensor if isinstance(event, Sampled) else None):
            raise IllegalEvent(f"{event} while sensor {asked!r} is read")
        takers = [state.asked[0]] if state.asked else list(self.roles)
        match event:
            case Started():
                state = replace(state, stored=self._unpacked(event.stored))
            case Received():
                takers = self.consumers(event.message)
            case ClockSet():
                takers = self.followers
            case Timer(name=prefixed) | PortRead(port=prefixed):
                name, _, own = prefixed.partition("/")
                if name not in self.roles:
                    raise IllegalEvent(f"{prefixed!r} belongs to none of {', '.join(self.roles)}")
                takers = [name]
                event = replace(event, name=own) if isinstance(event, Timer) else replace(event, port=own)
        return _Turn(self, state, event.now).run(takers, event)

    def _unpacked(self, stored: bytes) -> dict[str, bytes]:
        """What each role stored; nothing of bytes that no host stored."""
        try:
            found = msgpack.unpackb(stored)
        except (ValueError, TypeError, OverflowError, RecursionError, msgpack.UnpackException):
            return {}
        known = found if isinstance(found, dict) else {}
        return {name: data for name, data in known.items() if name in self.roles and isinstance(data, bytes)}

    def consumers(self, message: Any) -> list[str]:
        """The names of the roles that consume a message."""
        return [name for name, role in self.roles.items() if kind_name(message) in role.kinds]


class _Turn:
    """An event on its way through the roles, to its end or to the next reading of a sensor."""

    def __init__(self, host: Host, state: Hosted, now: int) -> None:
        self.host, self.now, self.states, self.receivers = host, now, dict(state.states), dict(state.receivers)
        self.stored, self.counts = state.stored, state.counts
        self.work, self.effects, self.handed = deque(state.work), list[Effect](), 0

    def run(self, takers: list[str], event: Event) -> tuple[Hosted, tuple[Effect, ...]]:
        self._feed(takers, event, on_air=isinstance(event, Received))
        while self.work:
            name, item = self.work.popleft()
            if isinstance(item, Received | ClockSet):
                self._feed([name], item, on_air=False)
            elif isinstance(item, Sample):
                return self._after(asked=(name, item.sensor)), (*self.effects, item)
            else:
                self._do(name, item)
        return self._after(), tuple(self.effects)

    def _after(self, asked: tuple[str, str] | None = None) -> Hosted:
        return Hosted(self.states, self.receivers, asked, tuple(self.work), self.stored, self.counts)

    def _feed(self, takers: list[str], event: Event, *, on_air: bool) -> None:
        """Let roles handle an event; their effects come before all other work."""
        asked, verdicts = list[tuple[str, Effect]](), dict[str, Ignored | Late]()
        for name in takers:
            own = replace(event, stored=self.stored.get(name, b"")) if isinstance(event, Started) else event
            self.states[name], effects = self.host.roles[name].handle(self.states[name], own)
            asked += [(name, effect) for effect in effects if not isinstance(effect, Ignored | Late)]
            for verdict in effects:
                if isinstance(verdict, Ignored | Late):
                    verdicts[name] = verdict
        if on_air:
            self._count(takers, verdicts)
        self._judge(takers, verdicts, on_air=on_air)
        self.work.extendleft(reversed(asked))

    def _judge(self, takers: list[str], verdicts: Mapping[str, Ignored | Late], *, on_air: bool) -> None:
        """Say of a frame that it is of no use, or late, if that is so of all takers; else only note it.

        What was handed over is no frame.
        """
        if on_air and len(verdicts) == len(takers):
            late = [verdict for verdict in verdicts.values() if isinstance(verdict, Late)]
            self.effects.append(next(iter((*late, *verdicts.values())), Ignored("unexpected")))
            return
        for name, verdict in verdicts.items():
            if isinstance(verdict, Ignored):
                self.effects.append(Note(f"{name} ignored a message: {verdict.reason}"))

    def _count(self, takers: list[str], verdicts: Mapping[str, Ignored | Late]) -> None:
        counts = dict(self.counts)
        for name in takers:
            delivered, ignored = counts.get(name, (0, 0))
            counts[name] = delivered + 1, ignored + isinstance(verdicts.get(name), Ignored)
        self.counts = counts

    def _do(self, name: str, effect: Effect) -> None:
        match effect:
            case Send():
                self._send(name, effect)
            case Radio() | Listen():
                self._switch(name, effect)
            case SetTimer() | CancelTimer():
                self.effects.append(replace(effect, name=f"{name}/{effect.name}"))
            case Write():
                self.effects.append(replace(effect, port=f"{name}/{effect.port}"))
            case State(lane=lane):
                self.effects.append(replace(effect, lane=f"{name}/{lane}" if lane else name))
            case Store(data):
                self.stored = {**self.stored, name: data}
                self.effects.append(Store(msgpack.packb(self.stored)))
            case Corrected(correction_ns):
                self.effects.append(effect)
                told = ClockSet(self.now, correction_ns)
                self.work.extend((follower, told) for follower in self.host.followers if follower != name)
            case _:
                self.effects.append(effect)

    def _send(self, name: str, send: Send) -> None:
        ids = frozenset({send.to}) if isinstance(send.to, str) else send.to
        takers = [n for n in self.host.consumers(send.message) if n != name] if self.host.id in ids else []
        if takers:
            self.handed += len(takers)
            if self.handed > MAX_HANDED:
                raise IllegalEvent(f"{self.host.id}: over {MAX_HANDED} messages between its roles at one instant")
            received = Received(self.now, decode(encode(send.message)), self.host.id)
            self.work.extend((taker, received) for taker in takers)
            send = replace(send, to=ids - {self.host.id})
        if send.to:
            self.effects.append(send)

    def _switch(self, name: str, wish: Wish) -> None:
        before = self._receiver(wish.medium)
        self.receivers[name, wish.medium] = wish
        if (after := self._receiver(wish.medium)) != before:
            self.effects.append(after)

    def _receiver(self, medium: Medium) -> Wish:
        """How the receiver listens, for all roles."""
        on = Radio(on=True, medium=medium)
        wishes = {self.receivers.get((role, medium), on) for role in self.host.roles}
        windows = [wish for wish in wishes if isinstance(wish, Listen)]
        if on in wishes or len(windows) > 1:
            return on
        return windows[0] if windows else Radio(on=False, medium=medium)
