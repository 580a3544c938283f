"""Who leads, in terms: at any time one process of a group, as far as the others hear.

A term is a number and the id of its leader. The number grows by one with each hand-over and each take-over; of two
terms the higher one holds, by number and then by id (as the epochs and ballots of Lamport 1998, "The part-time
parliament", but without a majority: who is cut off goes on tracking). Whoever hears of a higher term follows it, and a
leader that does so yields.

A follower in reach of the leader hears it at every step. If it does not for ``timeout_ns``, it asks the others whether
they did of late, as its own link may be bad (Das, Gupta, Motivala 2002, "SWIM"). If nobody did, the leader is taken for
dead, and the followers take over in an order that all of them know: the one of ``rank`` r after 1 + r times
``turn_ns``, unless it hears of a higher term before that.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Final, Literal, NamedTuple

from trackfield.role import CancelTimer, Effect, SetTimer

TIMER: Final = "lease"
TAKE_OVER: Final = "take-over"
MOST_NUMBER: Final = 2**30
"""No run has so many terms: what is said of higher ones is not believed, so that numbers always have room to grow."""


class Term(NamedTuple):
    """The ``number`` of a term, and the id of its ``leader``; empty: nobody led yet, or the term is over."""

    number: int = 0
    leader: str = ""


@dataclass(frozen=True, slots=True)
class Held:
    """The highest ``term`` that a process knows of; ``watched``: it heard the leader, last at ``heard_ns``, and should.

    ``over`` is the last term that was ended by its leader: nobody takes that one over, or follows it any more.
    """

    term: Term = field(default_factory=Term)
    watched: bool = False
    heard_ns: int = 0
    over: Term = field(default_factory=Term)

    def leads(self, id: str) -> bool:
        """Whether process ``id`` leads."""
        return self.term.leader == id


News = Literal["", "yielded", "follows", "outdated"]
"""What hearing of a term means: nothing new; this process led, and yields; it follows another one; nothing any more."""
Step = tuple[Held, tuple[Effect, ...], News]


@dataclass(frozen=True)
class Lease:
    """The part of process ``id``; a leader that is silent for ``timeout_ns`` is taken for dead.

    When the timer ``TIMER`` rings, the role asks for that of its turn (``silent``); when ``TAKE_OVER`` rings, it takes
    over by ``lead``, with the next number.
    """

    id: str
    timeout_ns: int
    turn_ns: int

    def begin(self) -> Held:
        """Nobody leads yet."""
        return Held()

    def hear(self, held: Held, now: int, term: Term, *, direct: bool, near: bool) -> Step:
        """A message says that this is the term; ``direct``: its leader sent it. ``near``: the leader is in reach."""
        if term < held.term or term <= held.over or term.leader == self.id or term.number > MOST_NUMBER:
            known = term == held.term
            return held, (), "" if known else "outdated"
        watched = direct or near
        timer = SetTimer(TIMER, now + self.timeout_ns) if watched else CancelTimer(TIMER)
        if term > held.term:
            news: News = "yielded" if held.leads(self.id) else "follows"
            held = replace(held, term=term, watched=watched, heard_ns=now)
            return held, (timer, CancelTimer(TAKE_OVER)), news
        if not direct:
            return held, (), ""
        return replace(held, watched=True, heard_ns=now), (timer, CancelTimer(TAKE_OVER)), ""

    def vouches(self, held: Held, now: int, term: Term) -> bool:
        """Whether it knows that the leader of this term is alive: it is that itself, or heard it of late."""
        fresh = held.watched and now - held.heard_ns < self.timeout_ns // 2
        return term == held.term and (held.leads(self.id) or fresh)

    def vouched(self, held: Held, now: int, term: Term) -> tuple[Effect, ...]:
        """Another process says that the leader of this term is alive: it is waited for once more."""
        if term != held.term or not held.watched:
            return ()
        return SetTimer(TIMER, now + self.timeout_ns), CancelTimer(TAKE_OVER)

    def end(self, held: Held, number: int) -> tuple[Held, tuple[Effect, ...]]:
        """The leader of the term with this number says that it is over."""
        if number < held.term.number:
            return held, ()
        return Held(Term(number, ""), over=Term(number, held.term.leader)), _STOPS

    def lead(self, held: Held, number: int) -> tuple[Held, tuple[Effect, ...]]:
        """This process leads from now on, in the term of this number."""
        return replace(held, term=Term(number, self.id), watched=False), _STOPS

    def follow(self, held: Held, now: int, term: Term) -> tuple[Held, tuple[Effect, ...]]:
        """This process led, and another one does from now on, in reach of it."""
        return replace(held, term=term, watched=True, heard_ns=now), (SetTimer(TIMER, now + self.timeout_ns),)

    def silent(self, held: Held, now: int, rank: int) -> SetTimer | None:
        """The leader was silent for too long: when it is this process's turn; ``rank`` 0 is the first. None: never."""
        if not held.watched or held.leads(self.id):
            return None
        return SetTimer(TAKE_OVER, now + (1 + rank) * self.turn_ns)


_STOPS: Final = (CancelTimer(TIMER), CancelTimer(TAKE_OVER))
