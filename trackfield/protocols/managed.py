"""Any role, with orders of system control to start, to stop, and to say how it is (``trackfield/wire/outside.py``).

While it is stopped, the role inside gets no event: its timers are cancelled, its state is dropped but for what it
stored last, and its receivers are off but for the backbone, where orders come. A start begins a new life of it. A stop
holds until the next start, even if the process itself dies and lives again.

An order is done once: its number must be newer than that of the last one. The last one, repeated, is answered again, as
often as it may be sent again. All else is refused and counted. A refusal is answered at most once in ``REFUSAL_NS``, to
somebody with an address: a stranger cannot make a process send without end.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import msgpack

from trackfield.protocols.orders import OK, REFUSED, TRIES, UNKNOWN, is_genuine, is_newer, reply_to
from trackfield.role import (
    NS,
    CancelTimer,
    Effect,
    Event,
    Ignored,
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
)
from trackfield.wire.keys import Medium
from trackfield.wire.outside import ITEMS, RUNNING, START, STOP, STOPPED, VERBS, Order
from trackfield.words import plain

KINDS: Final = frozenset({"order"})
BACKBONE: Final[Medium] = "backbone"
LANE: Final = "managed"
REFUSAL_NS: Final = NS
"""Refused orders are answered at most this often; whoever sends them costs the process no more than that."""
MOST_REFUSED: Final = 65535
"""The count in a reply goes no further."""

Outcome = tuple["Wrapped", tuple[Effect, ...]]


class Last(NamedTuple):
    """The last order that was accepted, and the answer to it."""

    number: int
    verb: int
    answer: int


@dataclass(frozen=True, slots=True)
class Wrapped:
    """The state of the role, whether it runs, its timers and lanes, and what it stored last.

    ``asked`` readings of sensors are awaited; ``stale`` are awaited by a life that was stopped, and go to nobody.
    ``again`` is how often the ``last`` order was repeated; ``refused`` counts orders, the last such one was answered at
    ``refusal_ns``.
    """

    role: Any
    runs: bool = True
    timers: frozenset[str] = frozenset()
    lanes: frozenset[str] = frozenset()
    stored: bytes = b""
    asked: int = 0
    stale: int = 0
    last: Last | None = None
    again: int = 0
    refused: int = 0
    refusal_ns: int | None = None


class Managed:
    """The ``role`` of process ``id``, which takes orders of the process ``operator`` with this ``key`` (hexadecimal).

    ``media`` are what the process is connected to, ``near`` those whom it can answer.
    """

    def __init__(
        self,
        role: Role[Any],
        *,
        id: str,
        key: str,
        operator: str,
        media: Collection[Medium] = (BACKBONE,),
        near: Collection[str] = (),
    ) -> None:
        self.role, self.id, self.key, self.operator = role, id, bytes.fromhex(key), operator
        self.others = sorted(set(media) - {BACKBONE})
        self.near = {*near, operator}
        self.kinds = frozenset(role.kinds) | KINDS
        self.follows = bool(getattr(role, "follows", False))

    def begin(self) -> Wrapped:
        """The state before ``Started``."""
        return Wrapped(self.role.begin())

    def handle(self, state: Wrapped, event: Event) -> Outcome:
        """See ``trackfield.role.Role``."""
        if isinstance(event, Started):
            return self._started(state, event)
        if isinstance(event, Received) and isinstance(event.message, Order):
            return self._ordered(state, event)
        if isinstance(event, Sampled) and state.stale:
            return replace(state, stale=state.stale - 1), ()
        if not state.runs:
            return state, (Ignored("stopped"),) if isinstance(event, Received) else ()
        return self._told(state, event)

    # --- the role inside ------------------------------------------------------------------------------------------

    def _started(self, state: Wrapped, event: Started) -> Outcome:
        """The process begins a life: the role inside does, too, unless it was stopped before."""
        state = _unpacked(state, event.stored)
        if not state.runs:
            return state, (*self._receivers(on=False), State("stopped", LANE))
        return self._told(state, replace(event, stored=state.stored))

    def _told(self, state: Wrapped, event: Event) -> Outcome:
        """The role inside handles an event."""
        timers, lanes, asked = state.timers, state.lanes, state.asked - isinstance(event, Sampled)
        if isinstance(event, Timer):
            timers -= {event.name}
        role, effects = self.role.handle(state.role, event)
        state, done = replace(state, role=role), list[Effect]()
        for effect in effects:
            if isinstance(effect, SetTimer):
                timers |= {effect.name}
            elif isinstance(effect, CancelTimer):
                timers -= {effect.name}
            elif isinstance(effect, State):
                lanes |= {effect.lane}
            elif isinstance(effect, Store):
                state = replace(state, stored=effect.data)
            asked += isinstance(effect, Sample)
            done.append(_packed(state) if isinstance(effect, Store) else effect)
        return replace(state, timers=timers, lanes=lanes, asked=max(asked, 0)), tuple(done)

    def _stop(self, state: Wrapped) -> Outcome:
        effects: tuple[Effect, ...] = (
            *(CancelTimer(name) for name in sorted(state.timers)),
            *self._receivers(on=False),
            *(State("stopped", lane) for lane in sorted(state.lanes | {LANE})),
        )
        stopped = replace(
            state,
            role=self.role.begin(),
            runs=False,
            timers=frozenset(),
            lanes=frozenset(),
            asked=0,
            stale=state.stale + state.asked,
        )
        return stopped, effects

    def _start(self, state: Wrapped, now: int) -> Outcome:
        state, effects = self._told(replace(state, runs=True), Started(now, state.stored))
        return state, (*self._receivers(on=True), State("running", LANE), *effects)

    def _receivers(self, *, on: bool) -> tuple[Radio, ...]:
        """Those of all media; that of the backbone is always on, whatever the role inside made of it."""
        return (*(Radio(on, medium) for medium in self.others), Radio(True, BACKBONE))

    # --- orders ---------------------------------------------------------------------------------------------------

    def _ordered(self, state: Wrapped, event: Received) -> Outcome:
        order: Order = event.message
        if why := self._fault(state, event):
            return self._refused(state, event, why)
        if (last := state.last) is not None and order.number == last.number:
            state = replace(state, again=state.again + 1)
            return state, (self._reply(state, event, last.answer),)
        answer = OK if order.verb < len(VERBS) else UNKNOWN
        state = replace(state, last=Last(order.number, order.verb, answer), again=0)
        if answer == UNKNOWN:
            state = replace(state, refused=min(state.refused + 1, MOST_REFUSED))
            told = _refusal(event.sender, "unknown verb")
            return state, (_packed(state), self._reply(state, event, answer), *told)
        effects = tuple[Effect, ...]()
        if order.verb == STOP and state.runs:
            state, effects = self._stop(state)
        elif order.verb == START and not state.runs:
            state, effects = self._start(state, event.now)
        return state, (_packed(state), self._reply(state, event, answer), *effects)

    def _fault(self, state: Wrapped, event: Received) -> str:
        """Why an order is refused; empty if it is not."""
        order, last = event.message, state.last
        if not is_genuine(order, self.id, self.key):
            return "wrong authentication"
        if event.sender != self.operator:
            return "wrong sender"
        if event.medium != BACKBONE:
            return "wrong medium"
        if last is None or is_newer(order.number, last.number):
            return ""
        if (order.number, order.verb) != (last.number, last.verb):
            return "old number"
        return "" if state.again < TRIES - 1 else "repeated too often"

    def _refused(self, state: Wrapped, event: Received, why: str) -> Outcome:
        state = replace(state, refused=min(state.refused + 1, MOST_REFUSED))
        effects: tuple[Effect, ...] = _refusal(event.sender, why)
        since = None if state.refusal_ns is None else event.now - state.refusal_ns
        reachable = event.medium == BACKBONE and event.sender in self.near
        if reachable and (since is None or not 0 <= since < REFUSAL_NS):
            state = replace(state, refusal_ns=event.now)
            effects = (self._reply(state, event, REFUSED), *effects)
        return state, effects

    def _reply(self, state: Wrapped, event: Received, answer: int) -> Send:
        said = answer, RUNNING if state.runs else STOPPED, state.refused
        return Send(reply_to(event.message, self.id, event.sender, said, self.key), event.sender, BACKBONE)


def _refusal(sender: str, why: str) -> tuple[Effect, ...]:
    return Tell("refused order", (plain(sender), why)), Ignored("refused order")


def _packed(state: Wrapped) -> Store:
    """What outlives the process: the last order, whether the role runs, and what it stored."""
    return Store(msgpack.packb([list(state.last or ()), state.runs, state.stored]))


def _unpacked(state: Wrapped, stored: bytes) -> Wrapped:
    """The state with what ``_packed`` packed; unchanged by bytes that it did not."""
    try:
        last, runs, inside = msgpack.unpackb(stored)
        number, verb, answer = last or (0, 0, 0)
        if not (0 <= number < ITEMS and verb >= 0 and answer >= 0 and isinstance(inside, bytes)):
            return state
    except (ValueError, TypeError, OverflowError, RecursionError, msgpack.UnpackException):
        return state
    return replace(state, last=Last(number, verb, answer) if last else None, runs=bool(runs), stored=inside)
