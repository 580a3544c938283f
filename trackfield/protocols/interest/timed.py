"""What a process does later: it spreads its own interests anew, tells all neighbours what it heard, and paces its data.

Neighbours that hear a flood at the same instant would all hand it on at once; so each waits for a jitter, drawn by key.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Final

from trackfield.protocols.interest.interests import MOST_INTERESTS, REFRESHES, Key, Wanted
from trackfield.protocols.interest.paths import kept
from trackfield.protocols.interest.traffic import Parcel
from trackfield.role import NS, CancelTimer, SetTimer

REFRESH: Final = "interest:refresh"
SPREAD: Final = "interest:spread"
PACE: Final = "interest:pace"
PATIENCE: Final = "interest:patience"
MOST_DUE: Final = 64
"""Of more floods that are to be handed on, the oldest are forgotten."""


@dataclass(frozen=True, slots=True)
class Due:
    """At ``at_ns`` all neighbours are told: a ``parcel``, for ``spread`` hops more; without one, the interest.

    A parcel for 0 hops is an own empty message, which is spread as far as the sink is then.
    """

    at_ns: int
    key: Key
    parcel: Parcel | None = None
    spread: int = 0


@dataclass(frozen=True, slots=True)
class Own:
    """An interest of this process, which it spreads anew at ``next_ns``."""

    wanted: Wanted
    next_ns: int

    @property
    def every_ns(self) -> int:
        """The time between two refreshes."""
        return max(int(self.wanted.lasts_s * NS / REFRESHES), 1)


@dataclass(frozen=True, slots=True)
class Paced:
    """Under an interest the next message may leave at ``next_ns``; ``message`` is the latest that waits for it."""

    next_ns: int
    message: bytes | None = None


@dataclass(frozen=True, slots=True)
class Timed:
    """What is ``due``, what is asked for (``own``, by number), and what is ``paced``.

    ``refresh`` is the number of the next refresh of any own interest.
    """

    due: tuple[Due, ...] = ()
    own: Mapping[int, Own] = field(default_factory=dict)
    paced: Mapping[Key, Paced] = field(default_factory=dict)
    refresh: int = 0

    def later(self, due: Due) -> Timed:
        """One more is due."""
        return replace(self, due=(*self.due, due)[-MOST_DUE:])

    def ripe(self, now: int) -> tuple[Timed, tuple[Due, ...]]:
        """The rest, and what is due now."""
        ripe = sorted((one for one in self.due if one.at_ns <= now), key=lambda one: one.at_ns)
        return replace(self, due=tuple(one for one in self.due if one.at_ns > now)), tuple(ripe)

    def pacing(self, key: Key, paced: Paced, now: int) -> Timed:
        """The same with the pace under an interest; of others it is forgotten when it holds nothing up any longer."""
        others = {one: of for one, of in self.paced.items() if of.message is not None or of.next_ns > now}
        return replace(self, paced=kept(others, key, paced, MOST_INTERESTS))

    def alarms(self) -> dict[str, int]:
        """The timers that this needs."""
        of_all: dict[str, Iterable[int]] = {
            SPREAD: (one.at_ns for one in self.due),
            REFRESH: (one.next_ns for one in self.own.values()),
            PACE: (one.next_ns for one in self.paced.values() if one.message is not None),
        }
        first = {name: min(times, default=None) for name, times in of_all.items()}
        return {name: at for name, at in first.items() if at is not None}

    def timers(self, before: Timed, *, rung: str = "") -> tuple[SetTimer | CancelTimer, ...]:
        """What changes of the timers since ``before``, and since one of them rang."""
        past, now = before.alarms(), self.alarms()
        past.pop(rung, None)
        gone = tuple(CancelTimer(name) for name in past if name not in now)
        return (*gone, *(SetTimer(name, at) for name, at in now.items() if past.get(name) != at))
