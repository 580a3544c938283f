"""What passes between the parts of the launcher about an event: a target that passes a cluster of sensors that hear."""

from __future__ import annotations

from math import atan2, degrees, hypot
from typing import Final, NamedTuple

from numpy import float64
from numpy.typing import NDArray

Array = NDArray[float64]
Line = tuple[float, float, float, float]
"""A straight path by a state on it: x, y (m), vx, vy (m/s)."""


RANKS: Final = ("loudest", "weakest")
"""Of which sensors of an event sounds are kept, in this order."""


class Report(NamedTuple):
    """A ``sensor`` said that it heard a target loudest at ``at_ns``, and how: strength (dB), and width d/v (s)."""

    sensor: str
    at_ns: int
    strength_db: float
    width_s: float


class Outcome(NamedTuple):
    """How an event ended for a tracker, as it published that at ``told_ns`` for the instant ``at_ns``.

    With a fix, that is its ``line``, as a state at ``at_ns``, with the covariance (16,) of that, row by row. Without
    one ``refused`` says why.
    """

    tracker: str
    at_ns: int
    told_ns: int
    event_ns: int
    refused: str
    line: Line | None
    covariance: tuple[float, ...] = ()

    @property
    def text(self) -> str:
        """The speed and the heading of the fix, or why there is none."""
        if self.line is None:
            return f"no fix: {self.refused}" if self.refused else "no fix"
        _, _, vx, vy = self.line
        return f"{hypot(vx, vy):.1f} m/s towards {degrees(atan2(vx, vy)) % 360.0:.0f}°"


class Tried(NamedTuple):
    """What ECPA considers (Yang et al., section 3.3): the ``lone`` sensor, three ``far`` ones across the path, and the
    lines that these give, each as the state when the target is nearest to the middle of the sensors.
    """

    lone: str
    far: tuple[str, ...]
    lines: tuple[Line, ...]


class Event(NamedTuple):
    """The reports that ``head`` had of an event, in the order of their times, and what its trackers made of them."""

    head: str
    reports: tuple[Report, ...]
    outcomes: tuple[Outcome, ...]
    tried: Tried | None = None

    @property
    def begin_ns(self) -> int:
        """When the first of its sensors heard the target loudest or, if no report is known, when the event was."""
        return min((one.at_ns for one in self.reports), default=min(one.event_ns for one in self.outcomes))

    @property
    def end_ns(self) -> int:
        """When the first of its trackers had published."""
        return min(one.told_ns for one in self.outcomes)

    @property
    def ranked(self) -> list[str]:
        """The sensors, the loudest first, each once."""
        ordered = sorted(self.reports, key=lambda one: (-one.strength_db, one.sensor))
        return list(dict.fromkeys(one.sensor for one in ordered))


class Sound(NamedTuple):
    """What a ``sensor`` heard of an event, from ``first_ns`` on at ``rate`` samples a second.

    ``levels`` (n, 3) are dB every 20 ms: time (s) since ``first_ns``, the mean square of what it heard above 100 Hz,
    and the fitted curve. It was loudest at ``peak_ns``, and known at ``known_ns``; None: no pass was found.
    """

    sensor: str
    first_ns: int
    rate: int
    samples: Array
    levels: Array
    peak_ns: int | None
    known_ns: int | None
