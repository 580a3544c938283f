"""Directed diffusion: who wants data floods an interest, and data flows back along the gradients that this leaves.

After Intanagonwiwat, Govindan, Estrin (2000), "Directed diffusion: a scalable and robust communication paradigm for
sensor networks", sections 3.1 to 3.4:

- a *sink* floods an interest, anew every third of its duration (``ask``). Each process hands on the first copy of each
  refresh, after a jitter. A neighbour from which a copy came is a *gradient* (``interests``); it expires after two
  missed refreshes. A sink that dies, or ``withdraw``s, is thereby forgotten;
- a *source* that hears of an interest which covers its place says by an empty message where it is, until it has a path.
  That floods, but only over processes that may be on a way to the sink. The first copy's path is reinforced, from the
  sink back to the source (``paths``);
- data (``tell``) goes along the reinforced path, or the best gradient where there is none yet, and around neighbours
  that do not acknowledge it (``carrying``). If a message reaches the sink by another neighbour than before, its path is
  reinforced in place of the old one.

A process that starts again knows nothing; the next refresh tells it all it needs.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from typing import Any, Final

from trackfield.draw import bits, uniform
from trackfield.protocols.interest.carrying import Carrier
from trackfield.protocols.interest.interests import NUMBERS, Key, Known, Wanted, covers
from trackfield.protocols.interest.state import Spread, Step
from trackfield.protocols.interest.timed import PACE, PATIENCE, REFRESH, SPREAD, Due, Own, Paced
from trackfield.role import (
    NEIGHBOURHOOD,
    NS,
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    Note,
    Received,
    Send,
    Started,
    Timer,
)
from trackfield.wire.codec import WireError, decode, encode
from trackfield.wire.interests import MOST_HOPS, Data, DataAck, Interest, Reinforce

KINDS: Final = frozenset({"interest", "data", "reinforce", "data-ack"})
TIMERS: Final = frozenset({REFRESH, SPREAD, PACE, PATIENCE})
HOP_NS: Final = NS // 50
PATIENCE_NS: Final = NS // 20
QUEUE: Final = 16
EXPLORE_NS: Final = NS
"""Sources say where they are within so long, or a sixth of the interest's duration if that is less."""
SLACK: Final = 1
"""A path that is explored may be so many hops longer than the gradients say."""


class Diffusion:
    """A protocol piece: process ``id`` at (``x_m``, ``y_m``).

    The role that it is part of keeps its ``Spread``, and gives it ``Started``, its ``TIMERS`` and the frames of its
    ``kinds``. Its receiver has to be on all the time. ``sources`` are the classes of data that it explores paths for as
    soon as it hears of an interest in them; for others the first message finds the path.

    A process waits for an acknowledgement for ``patience_ns`` to one and a half times that, and hands on a flood within
    ``hop_ns``. At most ``queue`` messages wait.
    """

    kinds: Final = KINDS

    def __init__(
        self,
        *,
        id: str,
        x_m: float,
        y_m: float,
        seed: int,
        sources: Collection[int] = (),
        patience_ns: int = PATIENCE_NS,
        hop_ns: int = HOP_NS,
        queue: int = QUEUE,
    ) -> None:
        self.id, self.place, self.seed, self.hop_ns = id, (x_m, y_m), seed, hop_ns
        self.sources = frozenset(sources)
        self.carrier = Carrier(id, seed, patience_ns, hop_ns, queue)

    def begin(self) -> Spread:
        """A process that has not started."""
        return Spread()

    def handle(self, state: Spread, event: Event) -> Step:
        """What it does with an event. Raises ``IllegalEvent`` for one that is not its own."""
        match event:
            case Started(now):
                serial, refresh = (
                    bits(self.seed, self.id, "interest", what, now) % NUMBERS for what in ("data", "own")
                )
                traffic, timed = replace(state.traffic, serial=serial), replace(state.timed, refresh=refresh)
                return Step(replace(state, traffic=traffic, timed=timed))
            case Timer(now, name) if name in TIMERS:
                return self._timed(state, self._ring(state, now, name), rung=name)
            case Received():
                return self._timed(state, self._receive(state, event))
        raise IllegalEvent(f"directed diffusion cannot handle {event}")

    # --- what the role asks for ----------------------------------------------------------------------------------

    def ask(self, state: Spread, now: int, wanted: Wanted) -> Step:
        """Spread an interest now, and again every third of its duration until it is withdrawn."""
        own = {**state.timed.own, wanted.number: Own(wanted, now)}
        asked = replace(state, timed=replace(state.timed, own=own))
        return self._timed(state, self._refresh(asked, now))

    def withdraw(self, state: Spread, number: int) -> Step:
        """Spread this interest no longer; others forget it when they miss its refreshes."""
        own = {one: of for one, of in state.timed.own.items() if one != number}
        return self._timed(state, Step(replace(state, timed=replace(state.timed, own=own))))

    def live(self, state: Spread, now: int, task: int) -> tuple[Known, ...]:
        """The interests in data of this class from here, own ones first."""
        own = (one.wanted for one in state.timed.own.values() if one.wanted.task == task)
        found = [(wanted.interest(self.id, 0), 0) for wanted in own]
        others = (one for one in state.interests.known.values() if one.interest.task == task and one.live(now))
        found += [(one.interest, one.hops) for one in others]
        return tuple(Known(one.sink.decode(), one.number, task, hops) for one, hops in found if covers(one, self.place))

    def tell(self, state: Spread, now: int, message: Any, known: Known) -> Step:
        """Send a message to the sink of an interest; if it is too early for one more, it waits, the latest of all."""
        before, encoded = state.timed.paced.get(known.key, Paced(now)), encode(message)
        if now < before.next_ns:
            timed = state.timed.pacing(known.key, replace(before, message=encoded), now)
            return self._timed(state, Step(replace(state, timed=timed)))
        return self._timed(state, self._told(state, now, known.key, encoded))

    # --- events --------------------------------------------------------------------------------------------------

    def _timed(self, before: Spread, step: Step, *, rung: str = "") -> Step:
        """The step, with its timers set."""
        timers = step.state.timed.timers(before.timed, rung=rung)
        return step._replace(effects=(*step.effects, *timers))

    def _ring(self, state: Spread, now: int, timer: str) -> Step:
        match timer:
            case "interest:refresh":
                return self._refresh(state, now)
            case "interest:spread":
                return self._spread(state, now)
            case "interest:pace":
                return self._paced(state, now)
        if not state.traffic.next:
            raise IllegalEvent("directed diffusion waits for no acknowledgement")
        return self.carrier.unanswered(state, now)

    def _receive(self, state: Spread, event: Received) -> Step:
        now, sender = event.now, event.sender
        if sender == self.id:
            return Step(state, (Ignored("unexpected"),))
        match event.message:
            case Interest() as interest:
                return self._heard(state, now, interest, sender)
            case Data() as data:
                return self.carrier.came(state, now, data, sender)
            case Reinforce() as reinforce:
                return self.carrier.reinforced(state, now, reinforce, sender)
            case DataAck() as ack:
                state = replace(state, paths=state.paths.heard(sender))
                return self.carrier.acknowledged(state, now, ack, sender)
        return Step(state, (Ignored("unexpected"),))

    # --- interests -----------------------------------------------------------------------------------------------

    def _refresh(self, state: Spread, now: int) -> Step:
        """Spread the own interests whose time has come."""
        timed, sent = state.timed, list[Effect]()
        for number, own in timed.own.items():
            if own.next_ns <= now:
                sent.append(Send(own.wanted.interest(self.id, timed.refresh), NEIGHBOURHOOD))
                again = {**timed.own, number: replace(own, next_ns=now + own.every_ns)}
                timed = replace(timed, own=again, refresh=(timed.refresh + 1) % NUMBERS)
        return Step(replace(state, timed=timed), tuple(sent))

    def _heard(self, state: Spread, now: int, copy: Interest, sender: str) -> Step:
        if copy.sink == self.id.encode():
            return Step(state, (Ignored("repeated"),))
        try:
            interests, why, news = state.interests.hear(now, copy, sender)
        except WireError as error:
            return Step(state, (Ignored(error.reason),))
        state = replace(state, interests=interests, paths=state.paths.heard(sender))
        if why or not news:
            return Step(state, (Ignored(why),) if why else ())
        key = (copy.sink.decode(), copy.number)
        timed = state.timed
        if copy.hops + 1 < copy.most_hops:
            timed = timed.later(Due(now + self._jitter_ns(self.hop_ns, "relay", *key, copy.refresh), key))
        if self._explores(state, key):
            span_ns = min(EXPLORE_NS, int(copy.lasts_s * NS / 6))
            at_ns = now + self._jitter_ns(span_ns, "explore", *key, copy.refresh)
            state, parcel = self.carrier.numbered(state, key, b"")
            timed = timed.later(Due(at_ns, key, parcel))
        return Step(replace(state, timed=timed))

    def _explores(self, state: Spread, key: Key) -> bool:
        """Whether this process is a source under this interest, needs a path to its sink, and knows none."""
        entry = state.interests.known[key]
        source = entry.interest.task in self.sources and covers(entry.interest, self.place)
        return source and entry.hops > 1 and (key, self.id) not in state.paths.onward

    def _spread(self, state: Spread, now: int) -> Step:
        """Tell all neighbours what is due."""
        timed, ripe = state.timed.ripe(now)
        sent = list[Effect]()
        for due in ripe:
            entry = state.interests.at(now, due.key)
            if entry is None:
                continue
            if due.parcel is None:
                if entry.hops >= entry.interest.most_hops:
                    continue  # of a later refresh, which came further
                sent.append(Send(replace(entry.interest, hops=entry.hops), NEIGHBOURHOOD))
            else:
                sent.append(Send(due.parcel.data(due.spread or min(entry.hops + SLACK, MOST_HOPS)), NEIGHBOURHOOD))
        return Step(replace(state, timed=timed), tuple(sent))

    # --- own data ------------------------------------------------------------------------------------------------

    def _told(self, state: Spread, now: int, key: Key, message: bytes) -> Step:
        """Send an own message, unless nobody wants it any longer."""
        sink, number = key
        own, entry = state.timed.own.get(number) if sink == self.id else None, state.interests.at(now, key)
        if own is None and entry is None:
            return Step(state, (Note(f"a message is dropped: {sink} does not want it any longer"),))
        interval_s = own.wanted.interval_s if own else entry.interest.interval_s if entry else 0.0
        timed = state.timed.pacing(key, Paced(now + int(interval_s * NS)), now)
        state = replace(state, timed=timed)
        if own is not None:
            return Step(state, (), (Received(now, decode(message), self.id),))
        return self.carrier.own(state, now, key, message)

    def _paced(self, state: Spread, now: int) -> Step:
        """Send what waited for its turn."""
        step = Step(state)
        for key, paced in state.timed.paced.items():
            if paced.message is not None and paced.next_ns <= now:
                timed = step.state.timed.pacing(key, replace(paced, message=None), now)
                step = step.then(self._told(replace(step.state, timed=timed), now, key, paced.message))
        return step

    def _jitter_ns(self, most_ns: int, *key: str | int) -> int:
        return int(most_ns * uniform(self.seed, self.id, "interest", *key))
