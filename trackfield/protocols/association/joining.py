"""The slave's side of association: it hears masters announce themselves and asks the nearest for a place.

Özfidan et al. (2018), Table I, gives each slave, in the order of their numbers, the nearest master that has a place
left. Here nobody knows all distances: a slave knows the masters that it hears. Each has a turn, by its number, so that
without losses and within reach of all the outcome is the same. It asks the nearest master of those with a place left,
by their answers to others. Without an answer it asks again, ``TRIES`` times in all; then, or if it is refused, the
next. A master of whose announcements it heard less than half is not asked: the link is too bad.

A slave that finds none is an orphan. It asks who is there, again and again, at long intervals. One that has a master
says at intervals that it still has its place (``renew``), and looks for another if that is not answered.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import hypot
from typing import Final

from trackfield.draw import uniform
from trackfield.role import (
    NEIGHBOURHOOD,
    CancelTimer,
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    Received,
    Send,
    SetTimer,
    Started,
    Timer,
)
from trackfield.wire.clusters import Admit, Announce, Join, Solicit

TRIES: Final = 3
"""How often a slave asks a master that does not answer."""
NO_PLACE: Final = 255
"""In place of a place in a list."""
KINDS: Final = frozenset({"announce", "admit"})
TIMERS: Final = frozenset({"turn", "answer", "renew"})
_NUMBERS: Final = 1 << 16


@dataclass(frozen=True, slots=True)
class Known:
    """What a slave knows of a master: its place, announcements ``heard`` ``of`` so many, and its ``free`` places."""

    x_m: float
    y_m: float
    heard: int
    of: int
    free: int

    @property
    def good(self) -> bool:
        """Whether at least half of what it announced was heard."""
        return 2 * self.heard >= self.of


@dataclass(frozen=True, slots=True)
class Search:
    """The ``master`` that has a ``place`` for a slave (empty: none has), and the search for one.

    ``asked`` is the master that is asked now, for the ``tries``-th time; ``passed`` are those that were, in vain.
    ``searches`` counts how often the slave asked who is there.
    """

    known: Mapping[str, Known] = field(default_factory=dict)
    master: str = ""
    place: int = NO_PLACE
    asked: str = ""
    tries: int = 0
    passed: frozenset[str] = frozenset()
    searches: int = 0
    looking: bool = False

    @property
    def receives(self) -> bool:
        """Whether its receiver must be on for the search."""
        return self.looking or bool(self.asked)


Step = tuple[Search, tuple[Effect, ...]]


@dataclass(frozen=True)
class Joining:
    """How the sensor ``id``, number ``sensor`` in the field's list, at ``x_m``, ``y_m``, finds a master.

    Masters announce themselves in the first ``announce_ns`` of a run; then each slave has a turn of ``turn_ns``.
    ``patience_ns`` is how long it waits for an answer, ``answers_ns`` for announcements after it asked who is there.
    An orphan asks again after ``again_ns``; a member renews its place after ``renew_ns``.
    """

    id: str
    sensor: int
    x_m: float
    y_m: float
    seed: int
    announce_ns: int
    turn_ns: int
    patience_ns: int
    answers_ns: int
    again_ns: int
    renew_ns: int

    def begin(self) -> Search:
        """A slave that has not started."""
        return Search()

    def handle(self, search: Search, event: Event) -> Step:
        """What it does with an event. Raises ``IllegalEvent`` for one that is not its own."""
        match event:
            case Started(now):
                due = self.announce_ns + self.sensor * self.turn_ns
                if now < due:
                    return replace(search, looking=True), (SetTimer("turn", due),)
                return self.seek(search, now)
            case Received(_, Announce() as announce, sender):
                return self._hear(search, announce, sender)
            case Received(now, Admit() as admit, sender):
                return self._answered(search, now, admit, sender)
            case Received():
                return search, (Ignored("unexpected"),)
            case Timer(now, name):
                return self._ring(search, now, name)
        raise IllegalEvent(f"association cannot handle {event}")

    def _ring(self, search: Search, now: int, timer: str) -> Step:
        match timer:
            case "turn":
                return self._turn(search, now)
            case "answer" if search.asked:
                return self._unanswered(search, now)
            case "renew":
                return self.renew(search, now)
        raise IllegalEvent(f"association has no timer {timer!r} now")

    def seek(self, search: Search, now: int) -> Step:
        """Ask who is there, and look for a master among those that answer."""
        number = search.searches + 1
        found = Search(searches=number, looking=True)
        ask = Send(Solicit(number % _NUMBERS), NEIGHBOURHOOD)
        return found, (CancelTimer("answer"), CancelTimer("renew"), ask, SetTimer("turn", now + self.answers_ns))

    def renew(self, search: Search, now: int) -> Step:
        """Say to the master that its place is still taken."""
        if not search.master or search.asked:
            return search, ()
        return self._ask(replace(search, tries=0), now, search.master)

    # --- masters are heard ---------------------------------------------------------------------------------------

    def _hear(self, search: Search, announce: Announce, sender: str) -> Step:
        if search.master or not search.looking:
            return search, (Ignored("not looking"),)
        heard = search.known[sender].heard + 1 if sender in search.known else 1
        known = Known(announce.x_m, announce.y_m, heard, announce.of, announce.free)
        return replace(search, known={**search.known, sender: known}), ()

    def _answered(self, search: Search, now: int, admit: Admit, sender: str) -> Step:
        if admit.sensor != self.sensor:
            return self._overheard(search, admit, sender)
        if sender != search.asked:
            return search, (Ignored("outdated"),)
        if admit.place == NO_PLACE:
            return self._next(replace(search, passed=search.passed | {sender}), now)
        found = Search(master=sender, place=admit.place, searches=search.searches)
        return found, (CancelTimer("answer"), SetTimer("renew", now + self._spread(self.renew_ns, now)))

    def _overheard(self, search: Search, admit: Admit, sender: str) -> Step:
        """An answer to another slave tells how many places are left."""
        if search.master or sender not in search.known:
            return search, (Ignored("not looking"),)
        known = replace(search.known[sender], free=admit.free)
        return replace(search, known={**search.known, sender: known}), ()

    # --- masters are asked ---------------------------------------------------------------------------------------

    def _turn(self, search: Search, now: int) -> Step:
        """Its turn, or time to search again."""
        if search.master:
            return search, ()
        return self._next(search, now) if search.looking else self.seek(search, now)

    def _next(self, search: Search, now: int) -> Step:
        """Ask the next master; without one it is an orphan, until it searches again."""
        free = [
            (hypot(one.x_m - self.x_m, one.y_m - self.y_m), id)
            for id, one in search.known.items()
            if one.free and one.good and id not in search.passed
        ]
        if free:
            return self._ask(replace(search, tries=0), now, min(free)[1])
        again = SetTimer("turn", now + self._spread(self.again_ns, now))
        return Search(searches=search.searches), (CancelTimer("answer"), again)

    def _ask(self, search: Search, now: int, master: str) -> Step:
        search = replace(search, asked=master, tries=search.tries + 1)
        return search, (Send(Join(self.sensor), master), SetTimer("answer", now + self.patience_ns))

    def _unanswered(self, search: Search, now: int) -> Step:
        if search.tries < TRIES:
            return self._ask(search, now, search.asked)
        if search.master:  # it did not answer a renewal
            return self.seek(search, now)
        return self._next(replace(search, passed=search.passed | {search.asked}), now)

    def _spread(self, mean_ns: int, now: int) -> int:
        """A time around this, so that slaves that began together do not go on together."""
        return int(mean_ns * (0.9 + 0.2 * uniform(self.seed, self.id, "association", now)))
