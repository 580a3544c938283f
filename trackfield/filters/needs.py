"""What a tracker needs of the kinds of sensing in a field, and why a combination cannot work.

A tracker's class may have ``needs``, a tuple of the names below. One that says nothing takes any kinds whose readings
depend on (x, y, vx, vy) alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, NamedTuple

from trackfield.filters.types import Sensing

NO_UNKNOWNS: Final = "no unknowns"
DEFAULT: Final = (NO_UNKNOWNS,)


class Need(NamedTuple):
    """Whether these kinds meet it, and what a tracker that needs it takes."""

    met: Callable[[Mapping[str, Sensing]], bool]
    takes: str


NEEDS: Final[Mapping[str, Need]] = {
    "bearings": Need(lambda kinds: all(kind.bearings for kind in kinds.values()), "bearings only"),
    "one kind": Need(lambda kinds: len(kinds) == 1, "sensors of one kind only"),
    NO_UNKNOWNS: Need(
        lambda kinds: not any(kind.unknowns for kind in kinds.values()),
        "readings that depend on the target's position and velocity only",
    ),
}


def needs_of(maker: Any) -> Sequence[str]:
    """What trackers of this class need."""
    needs: Sequence[str] = getattr(maker, "needs", DEFAULT)
    return needs


def unmet(maker: Any, kinds: Mapping[str, Sensing]) -> str | None:
    """Why a tracker of this class cannot work with these kinds; None if it can."""
    for name in needs_of(maker):
        if name in NEEDS and not NEEDS[name].met(kinds):
            return f"takes {NEEDS[name].takes}, and the sensors are of kind {', '.join(kinds)}"
    return None
