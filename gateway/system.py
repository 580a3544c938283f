"""System control: orders to remote processes, as planned or as an operator gives them (docs/control.md)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple

import msgpack

from gateway.operator import ANSWER_END, END, Asked, Typed, lines_of, tagged, understood
from trackfield.protocols.orders import OK, TRIES, answers, following, order_for
from trackfield.role import (
    CancelTimer,
    Effect,
    Event,
    Ignored,
    PortRead,
    Received,
    Send,
    SetTimer,
    Started,
    State,
    Store,
    Tell,
    Timer,
    Write,
)
from trackfield.wire.outside import ANSWERS, ITEMS, RUNNING, STOPPED, VERBS, Order, OrderReply
from trackfield.words import plain, quoted

PORT: Final = "operator"
"""Where people type."""
PLANNED: Final = "planned"
ANSWER: Final = "answer:"
"""The timers: the next planned order, and the answer of a process."""
STATES: Final = {RUNNING: "running", STOPPED: "stopped"}
SILENT: Final = "silent"
UNKNOWN: Final = "unknown"
MOST_WAITING: Final = 16
"""An operator's order is refused if so many wait for the process already."""


class Wish(NamedTuple):
    """An order that is to be given: the planned one of this place, or that of an operator's line of this number."""

    verb: int
    planned: int | None = None
    line: int | None = None


class Given(NamedTuple):
    """An order that was sent so many times, and has no answer yet."""

    order: Order
    wish: Wish
    tries: int = 1


class Line(NamedTuple):
    """A line of an operator: its tag, from how many processes answers are due, and whether it asked for all."""

    tag: str
    due: int
    all: bool


@dataclass(frozen=True, slots=True)
class Memory:
    """The number of the last order; what is given, waits and is known, by process; the lines of operators, by number.

    ``planned`` is the place of the next planned order, ``settled`` those that need not be given any more.
    """

    number: int = 0
    planned: int = 0
    settled: frozenset[int] = frozenset()
    given: Mapping[str, Given] = field(default_factory=dict)
    waiting: Mapping[str, tuple[Wish, ...]] = field(default_factory=dict)
    known: Mapping[str, str] = field(default_factory=dict)
    lines: Mapping[int, Line] = field(default_factory=dict)
    typed: Typed = field(default_factory=Typed)


class System:
    """System control ``id``: gives orders to the ``managed`` processes, with the ``key`` (hexadecimal) of the run.

    Each has one order at a time; the next ones wait. An order is sent ``TRIES`` times at most: again after
    ``patience_ns``, which doubles each time. The planned ``orders`` are (instant ns, verb, process).
    """

    def __init__(
        self, *, id: str, key: str, managed: Sequence[str], patience_ns: int, orders: Sequence[Sequence[int | str]]
    ) -> None:
        self.id, self.key, self.managed, self.patience_ns = id, bytes.fromhex(key), tuple(managed), patience_ns
        planned = [(int(at_ns), VERBS.index(str(verb)), str(whom)) for at_ns, verb, whom in orders]
        self.orders = sorted(planned, key=lambda one: one[0])
        self.kinds = frozenset({"order-reply"})

    def begin(self) -> Memory:
        """A process that has not started."""
        return Memory()

    def handle(self, state: Memory, event: Event) -> tuple[Memory, tuple[Effect, ...]]:
        """See ``trackfield.role.Role``."""
        turn = _Turn(self, state, event.now)
        match event:
            case Started(_, stored):
                turn.state = _unpacked(state, stored)
                turn.plan()
            case Timer(_, name) if name == PLANNED:
                turn.plan()
            case Timer(_, name):
                turn.wait_no_longer(name.removeprefix(ANSWER))
            case Received(_, OrderReply() as reply, sender):
                turn.answered(reply, sender)
            case PortRead(_, _, data):
                turn.read(data)
            case _:
                turn.effects.append(Ignored("unexpected"))
        return turn.state, tuple(turn.effects)


class _Turn:
    """An event as it is handled."""

    def __init__(self, role: System, state: Memory, now: int) -> None:
        self.role, self.state, self.now, self.effects = role, state, now, list[Effect]()

    # --- planned orders -------------------------------------------------------------------------------------------

    def plan(self) -> None:
        """Give the planned orders that are due, and wait for the next one."""
        orders = self.role.orders
        while self.state.planned < len(orders) and orders[self.state.planned][0] <= self.now:
            place = self.state.planned
            _, verb, id = orders[place]
            self.state = replace(self.state, planned=place + 1)
            if place in self.state.settled:
                continue
            if id in self.role.managed:
                self._want(id, Wish(verb, planned=place))
            else:
                self.effects.append(Tell("order", (0, VERBS[verb], id, UNKNOWN)))
                self._settle(place)
        if self.state.planned < len(orders):
            self.effects.append(SetTimer(PLANNED, orders[self.state.planned][0]))

    # --- orders and their answers ---------------------------------------------------------------------------------

    def _want(self, id: str, wish: Wish) -> None:
        waiting = (*self.state.waiting.get(id, ()), wish)
        self.state = replace(self.state, waiting={**self.state.waiting, id: waiting})
        if id not in self.state.given:
            self._give(id)

    def _give(self, id: str) -> None:
        """Give a process the order that waits longest, if one does."""
        if not (waiting := self.state.waiting.get(id, ())):
            return
        wish, *others = waiting
        number = following(self.state.number)
        given = Given(order_for(id, number, wish.verb, self.role.key), wish)
        self.state = replace(
            self.state,
            number=number,
            given={**self.state.given, id: given},
            waiting={**self.state.waiting, id: tuple(others)},
        )
        self.effects.append(_packed(self.state))
        self._send(id, given)

    def _send(self, id: str, given: Given) -> None:
        due = self.now + (self.role.patience_ns << (given.tries - 1))
        self.effects += [Send(given.order, id, "backbone"), SetTimer(ANSWER + id, due)]

    def wait_no_longer(self, id: str) -> None:
        """The answer of a process did not come in time."""
        given = self.state.given[id]
        if given.tries < TRIES:
            given = given._replace(tries=given.tries + 1)
            self.state = replace(self.state, given={**self.state.given, id: given})
            self._send(id, given)
        else:
            self._over(id, SILENT, SILENT, f"{id} {SILENT}")

    def answered(self, reply: OrderReply, sender: str) -> None:
        """A reply came: that of a process to the order that it was given last, or one that is of no use."""
        given, role = self.state.given.get(sender), self.role
        if given is None or reply.number != given.order.number:
            self.effects.append(Ignored("unexpected"))
        elif not answers(reply, given.order, sender, role.id, role.key) or reply.answer >= len(ANSWERS):
            self.effects.append(Ignored("forged"))
        else:
            known = STATES.get(reply.state, UNKNOWN)
            said = f"{sender} {known}" if reply.answer == OK else f"refused by {sender}, which is {known}"
            self.effects.append(CancelTimer(ANSWER + sender))
            self._over(sender, ANSWERS[reply.answer], known, said)

    def _over(self, id: str, answer: str, known: str, said: str) -> None:
        """An order has its answer, or never will; the next one may be given."""
        given = self.state.given[id]
        others = {other: one for other, one in self.state.given.items() if other != id}
        self.effects.append(Tell("order", (given.order.number, VERBS[given.order.verb], id, answer)))
        if self.state.known.get(id) != known:
            self.effects.append(State(known, id))
        self.state = replace(self.state, given=others, known={**self.state.known, id: known})
        if given.wish.planned is not None:
            self._settle(given.wish.planned)
        if given.wish.line is not None:
            self._tell(given.wish.line, said)
        self._give(id)

    def _settle(self, place: int) -> None:
        self.state = replace(self.state, settled=self.state.settled | {place})
        self.effects.append(_packed(self.state))

    # --- operators ------------------------------------------------------------------------------------------------

    def read(self, data: bytes) -> None:
        """An operator typed; of what is not understood in these bytes, one line says so."""
        typed, lines = lines_of(self.state.typed, data)
        self.state = replace(self.state, typed=typed)
        complained = False
        for line in lines:
            asked = understood(line)
            if isinstance(asked, Asked):
                self._ask(asked)
            elif not complained:
                complained = True
                self._say("", asked)

    def _ask(self, asked: Asked) -> None:
        every = self.role.managed
        if asked.id and asked.id not in every:
            name = plain(asked.id) if asked.id.isprintable() else quoted(asked.id)
            self._say(asked.tag, f"unknown process {name}; processes: {', '.join(every)}")
            return
        ids = (asked.id,) if asked.id else every
        if full := next((id for id in ids if len(self.state.waiting.get(id, ())) >= MOST_WAITING), ""):
            self._say(asked.tag, f"refused: {MOST_WAITING} orders wait for {full} already")
            return
        number = max(self.state.lines, default=0) + 1
        line = Line(asked.tag, len(ids), not asked.id)
        self.state = replace(self.state, lines={**self.state.lines, number: line})
        for id in ids:
            self._want(id, Wish(asked.verb, line=number))

    def _tell(self, number: int, said: str) -> None:
        """Tell an operator what a process answered."""
        line = self.state.lines[number]
        self._say(line.tag, said)
        lines = {other: one for other, one in self.state.lines.items() if other != number}
        if line.due > 1:
            lines[number] = line._replace(due=line.due - 1)
        elif line.all:
            self._say(line.tag, END)
        self.state = replace(self.state, lines=lines)

    def _say(self, tag: str, text: str) -> None:
        self.effects.append(Write(PORT, tagged(tag, text).encode("ascii", "replace") + ANSWER_END))


def _packed(state: Memory) -> Store:
    """What outlives the process: the last number, so that none is used twice, and the planned orders that are done."""
    return Store(msgpack.packb([state.number, sorted(state.settled)]))


def _unpacked(state: Memory, stored: bytes) -> Memory:
    """The state with what ``_packed`` packed; unchanged by bytes that it did not."""
    try:
        number, settled = msgpack.unpackb(stored)
        if not 0 <= number < ITEMS:
            return state
        return replace(state, number=number, settled=frozenset(map(int, settled)))
    except (ValueError, TypeError, OverflowError, RecursionError, msgpack.UnpackException):
        return state
