"""What a tracker needs of the kinds of sensing in a field, and why a combination cannot work.

A tracker's class may have ``needs``, a tuple of the names below. One that says nothing takes any kinds whose readings
depend on (x, y, vx, vy) alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from trackfield.filters.types import Sensing

NO_UNKNOWNS: Final = "no unknowns"
POSITIONS: Final = "positions"
PASSES: Final = "passes"
DEFAULT: Final = (NO_UNKNOWNS,)

_DELAY_S: Final = 2.0
"""A reading may tell where the target was so long before; then it depends on the velocity as well, but little."""


class Need(NamedTuple):
    """Whether these kinds meet it, and what a tracker that needs it takes."""

    met: Callable[[Mapping[str, Sensing]], bool]
    takes: str


def _of_positions(kind: Sensing) -> bool:
    """Whether readings depend on the velocity by no more than a delay; the time of a pass does by more.

    Judged by the slopes at some states around a sensor: dh/dv is at most that many seconds of dh/dp.
    """
    if kind.passes is not None:
        return False
    angles = np.linspace(0.3, 2.0 * np.pi, 16)
    states = np.zeros((16, 4 + len(kind.unknowns)))
    states[:, 0], states[:, 1] = np.cos(angles), np.sin(angles)
    states[:, :2] *= kind.range_m * np.linspace(0.2, 0.9, 16)[:, None]
    states[:, 2:4] = 10.0 * np.stack((np.cos(5.0 * angles), np.sin(5.0 * angles)), axis=-1)
    states[:, 4:] = [one.mean for one in kind.unknowns]
    slopes = np.abs(kind.jacobian(states, np.zeros((1, 2))))
    return bool((slopes[..., 2:4].max(axis=-1) <= _DELAY_S * slopes[..., :2].max(axis=-1)).all())


NEEDS: Final[Mapping[str, Need]] = {
    "bearings": Need(lambda kinds: all(kind.bearings for kind in kinds.values()), "bearings only"),
    "one kind": Need(lambda kinds: len(kinds) == 1, "sensors of one kind only"),
    "one number": Need(lambda kinds: all(kind.m == 1 for kind in kinds.values()), "readings of one number only"),
    NO_UNKNOWNS: Need(
        lambda kinds: not any(kind.unknowns for kind in kinds.values()),
        "readings that depend on the target's position and velocity only",
    ),
    POSITIONS: Need(
        lambda kinds: all(map(_of_positions, kinds.values())),
        "readings that do not depend on the target's velocity",
    ),
    PASSES: Need(
        lambda kinds: all(kind.passes is not None for kind in kinds.values()),
        "reports of passes only",
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
