"""A sensor that hears a target: received level and direction of arrival, as a pure function of the time."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from math import degrees, hypot
from typing import TYPE_CHECKING, Any, Final, Protocol, Self

from trackfield.draw import normal
from trackfield.models.sound import bearing, level_db
from trackfield.world.path import Path

if TYPE_CHECKING:
    from trackfield.world.own import Reading

_NS: Final = 1_000_000_000
LOUDEST_DB: Final = 200.0
"""The highest level that an array shows, and that fits into a report (docs/wire.md)."""

Window = tuple[int, int]
"""(from ns, to ns), both included, in true time since the start of the run."""


@dataclass(frozen=True, slots=True)
class Heard:
    """What a sensor reads: level in dB, bearing to the source in degrees clockwise from north, [0, 360)."""

    level_db: float
    bearing_deg: float

    @classmethod
    def at(cls, level_db: float, angle_deg: float) -> Self:
        """The reading of an array that shows 200 dB at most, from any angle."""
        turned = angle_deg % 360.0  # a tiny negative angle rounds up to a full turn
        return cls(min(level_db, LOUDEST_DB), 0.0 if turned == 360.0 else turned)


def window_at(windows: Sequence[Window], t_ns: int) -> int | None:
    """The start (ns) of the window that this time lies in, or else of the next; None after the last."""
    i = bisect_left(windows, t_ns, key=lambda window: window[1])
    return windows[i][0] if i < len(windows) else None


class Ears(Protocol):
    """What a node asks of its sensor; times are true."""

    def sample(self, t_ns: int) -> Heard | Reading | None:
        """The reading at this time; None if nothing is heard."""
        ...

    def next_window(self, t_ns: int) -> int | None:
        """The start (ns) of the window that this time lies in, or else of the next; None after the last."""
        ...


@dataclass(frozen=True, slots=True)
class AcousticSensor:
    """The microphones of node ``id`` at ``position`` (x, y in metres), and the target that they may hear.

    ``windows`` hold all times at which the target may be audible here, in order and apart; of the ``path`` no
    more than those is needed. The source has ``source_db`` at 1 m and decays with ``alpha``; below
    ``audible_db`` nothing is heard. ``doa_sd_deg`` and ``level_sd_db`` are standard deviations of Gaussian
    noise, drawn anew for every instant.
    """

    id: str
    position: tuple[float, float]
    path: Path
    windows: tuple[Window, ...]
    source_db: float
    alpha: float
    audible_db: float
    doa_sd_deg: float
    level_sd_db: float
    seed: int
    incarnation: int = 0

    def sample(self, t_ns: int) -> Heard | None:
        """The reading at this true time; None if the target is not audible."""
        target = self.path.at(t_ns / _NS)
        if target is None:
            return None
        dx, dy = target[0] - self.position[0], target[1] - self.position[1]
        level = level_db(hypot(dx, dy), self.source_db, self.alpha)
        if level < self.audible_db:
            return None
        angle = degrees(bearing(dx, dy)) + self.doa_sd_deg * self._noise("doa", t_ns)
        return Heard.at(level + self.level_sd_db * self._noise("level", t_ns), angle)

    def next_window(self, t_ns: int) -> int | None:
        """The start (ns) of the window that this time lies in, or else of the next; None after the last."""
        return window_at(self.windows, t_ns)

    def to_plain(self) -> dict[str, Any]:
        """What makes the same sensor elsewhere: lists, numbers and text, and of the path what it needs."""
        path = self.path.cut((a / _NS, b / _NS) for a, b in self.windows)
        return {
            **{field.name: getattr(self, field.name) for field in fields(self)},
            "position": list(self.position),
            "path": path.to_plain(),
            "windows": [list(window) for window in self.windows],
        }

    @classmethod
    def from_plain(cls, plain: Mapping[str, Any]) -> Self:
        """The inverse of ``to_plain``."""
        x, y = plain["position"]
        return cls(
            **{
                **plain,
                "position": (x, y),
                "path": Path.from_plain(plain["path"]),
                "windows": tuple((a, b) for a, b in plain["windows"]),
            }
        )

    def _noise(self, purpose: str, t_ns: int) -> float:
        return normal(self.seed, self.id, self.incarnation, purpose, t_ns)
