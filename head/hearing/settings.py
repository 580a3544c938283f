"""What the head's half of a node is told: its cluster, and when it does what."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from trackfield.protocols.interest.interests import GRACE, MISSED, REFRESHES
from trackfield.role import NS

Heads = Literal["fixed", "loudest"]


@dataclass(frozen=True)
class Times:
    """When a head does what, ns.

    An event is over if no report was added for ``close_ns``, which is no less than the trackers wait. A new head waits
    ``gather_ns`` for the reports that its interest asks for. Of those that may take over, each waits ``turn_ns`` longer
    than the one before.
    """

    close_ns: int
    gather_ns: int
    turn_ns: int


@dataclass(frozen=True)
class Settings:
    """How the head's half of process ``id`` works; ``numbers`` are those of the field's sensors in its list.

    The ``group`` of a "fixed" cluster are its nodes by rank: the first leads, and of those that live the first one
    takes over. It hears the passes of all within ``radius_m`` of the centre of the cluster, its interest makes
    ``most_hops`` hops, and lasts ``interest_s`` unless it is renewed. Heads further away, up to ``hand_m``, send it
    their fixes (0: none do); a target counts as coming to the cluster if it will be within ``comes_m`` of the centre.

    Where the "loudest" node leads, the ``radius_m`` is around that node, and its head uses ``reports`` of those it gets
    (0: all).
    """

    id: str
    numbers: Mapping[str, int]
    times: Times
    heads: Heads = "fixed"
    group: tuple[str, ...] = ()
    radius_m: float = 60.0
    interest_s: float = 9.0
    most_hops: int = 4
    hand_m: float = 0.0
    comes_m: float = 60.0
    reports: int = 5

    @property
    def fixed(self) -> bool:
        """Whether clusters stay as they are."""
        return self.heads == "fixed"

    def rank(self, id: str) -> int | None:
        """The place of a node in the group; None: it is of another cluster."""
        return self.group.index(id) if id in self.group else None

    @property
    def lapse_ns(self) -> int:
        """An interest is over when so much time passed without a refresh: two were missed (``Entry.life_ns``)."""
        return round(self.interest_s * (MISSED + GRACE) / REFRESHES * NS)


def centre(places: Mapping[str, tuple[float, float]], ids: tuple[str, ...]) -> tuple[float, float]:
    """The mean place of some sensors (m)."""
    xs, ys = zip(*(places[id] for id in ids), strict=True)
    return sum(xs) / len(ids), sum(ys) / len(ids)
