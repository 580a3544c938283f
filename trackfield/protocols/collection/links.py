"""How good the link to a neighbour is: from beacons heard and missed, and from messages acknowledged.

A hybrid estimator as in CTP (Fonseca, Gnawali, Jamieson, Levis 2007, "Four-bit wireless link estimation"): beacons are
counted in windows of ``BEACONS`` by their numbers, tries in windows of ``TRIES``. A try succeeds if the message and its
acknowledgement arrive: the first with the share ``back``, the other with the share ``inward``. Beacons tell ``inward``;
until tries say otherwise, a link is taken to be equally good in both directions. What tries say of ``back`` is not
undone by beacons, or a link that works in one direction only would be tried again and again; they count a little
(``FORGIVING``), as a link that nobody tries may have become better.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, Self

from trackfield.wire.messages import NOWHERE, Route

BEACONS: Final = 3
"""CTP's window of beacons."""
TRIES: Final = 5
"""CTP's window of tries."""
MEMORY: Final = 10
"""CTP keeps nine tenths of what it knew at each window of beacons; of fewer windows the mean counts."""
LATEST: Final = 5
"""The same of tries."""
FORGIVING: Final = 50
"""The same of what beacons say of the other direction."""
MOST_MISSED: Final = 10
"""After a longer gap in the numbers of its beacons a neighbour is a new one: it was away, or was restarted."""
LEAST: Final = 0.1
"""Links on which fewer tries succeed are not used."""
_NUMBERS: Final = 1 << 16


def text_of(id: bytes) -> str:
    """An id out of a message; other processes may have put anything there, of which a ``?`` stands for what is none."""
    return "".join(letter if letter.isascii() and letter.isprintable() else "?" for letter in id.decode("latin-1"))


@dataclass(frozen=True, slots=True)
class Link:
    """A neighbour: its last beacon's ``number``, ``cost`` and ``parent``, and the windows that are being counted.

    ``inward`` is the mean share of its beacons that were heard, over ``windows``; ``back`` the share of messages that
    arrive there, over ``trials`` (none: not known). It is ``lost`` if it did not acknowledge a message, and has not
    been heard since.
    """

    number: int
    cost: float = NOWHERE
    parent: str = ""
    heard: int = 1
    sent: int = 1
    tried: int = 0
    acked: int = 0
    inward: float = 0.0
    windows: int = 0
    back: float = 0.0
    trials: int = 0
    lost: bool = False

    @property
    def success(self) -> float:
        """The share of tries that succeed, as far as is known: cautious before the first window is full."""
        return self._inward * (self.back if self.trials else self._inward)

    @property
    def _inward(self) -> float:
        return self.inward if self.windows else (self.heard + 1) / (self.sent + BEACONS)

    @property
    def etx(self) -> float:
        """The expected transmissions of a message to this neighbour until it is acknowledged."""
        return 1 / max(self.success, LEAST / 2)

    @property
    def usable(self) -> bool:
        """Whether messages may be sent to it."""
        return not self.lost and self.success >= LEAST

    @property
    def total(self) -> float:
        """The expected transmissions of a message by this neighbour to the base; ``NOWHERE`` if it knows no way."""
        return min(self.cost + self.etx, NOWHERE)

    @classmethod
    def first(cls, route: Route) -> Self:
        """A neighbour that was not known before its beacon."""
        return cls(route.number, route.cost, text_of(route.parent))

    def beacon(self, route: Route) -> Self:
        """The link after a beacon; if its number does not follow the last, nothing is known of the link as before."""
        ahead = (route.number - self.number) % _NUMBERS
        if not 1 <= ahead <= MOST_MISSED:
            return self.first(route)
        heard, sent = self.heard + 1, self.sent + ahead
        told = replace(
            self,
            number=route.number,
            cost=route.cost,
            parent=text_of(route.parent),
            heard=heard,
            sent=sent,
            lost=False,
        )
        if sent < BEACONS:
            return told
        windows = min(self.windows + 1, MEMORY)
        inward = self.inward + (heard / sent - self.inward) / windows
        back = self.back + (inward - self.back) / FORGIVING
        return replace(told, heard=0, sent=0, inward=inward, windows=windows, back=back)

    def trial(self, *, acked: bool) -> Self:
        """The link after a message was acknowledged, or was not in time."""
        after = replace(self, tried=self.tried + 1, acked=self.acked + acked)
        return after if after.tried < TRIES else after._learned()

    def failed(self) -> Self:
        """The link after a message was given up there: its window of tries is over."""
        return replace(self._learned() if self.tried else self, lost=True)

    def _learned(self) -> Self:
        """What a window of tries says; what was taken to be so without any counts like one."""
        sample = min(self.acked / self.tried / self._inward, 1.0)
        before = self.back if self.trials else self._inward
        trials = min(self.trials + 1, LATEST - 1)
        return replace(self, tried=0, acked=0, trials=trials, back=before + (sample - before) / (trials + 1))
