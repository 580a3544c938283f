"""A sensor that hears targets: received level and direction of arrival, as a pure function of the time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from math import degrees, hypot
from typing import Any, Final, Self

from trackfield.draw import normal
from trackfield.models.sound import bearing, level_db
from trackfield.sensing.readings import Heard, Window, window_at
from trackfield.world.path import Path

_NS: Final = 1_000_000_000


@dataclass(frozen=True, slots=True)
class AcousticSensor:
    """The microphone array of node ``id`` at ``position`` (x, y in metres), and the targets that it may hear.

    ``windows`` hold all times at which any target may be audible here, in order and disjoint; the ``paths`` are only
    used within them. Each source has ``source_db`` at 1 m and decays with ``alpha``; below ``audible_db`` nothing is
    heard, and of several targets only the loudest. ``doa_sd_deg`` and ``level_sd_db`` are standard deviations of
    Gaussian noise, drawn for every instant.
    """

    id: str
    position: tuple[float, float]
    paths: tuple[Path, ...]
    windows: tuple[Window, ...]
    source_db: float
    alpha: float
    audible_db: float
    doa_sd_deg: float
    level_sd_db: float
    seed: int
    incarnation: int = 0

    def sample(self, t_ns: int) -> Heard | None:
        """The reading of the loudest target at this true time, of equals the first; None if none is audible."""
        states = (path.at(t_ns / _NS) for path in self.paths)
        ways = [(state[0] - self.position[0], state[1] - self.position[1]) for state in states if state is not None]
        levels = [level_db(hypot(dx, dy), self.source_db, self.alpha) for dx, dy in ways]
        if not levels or (level := max(levels)) < self.audible_db:
            return None
        dx, dy = ways[levels.index(level)]
        angle = degrees(bearing(dx, dy)) + self.doa_sd_deg * self._noise("doa", t_ns)
        return Heard.at(level + self.level_sd_db * self._noise("level", t_ns), angle)

    def next_window(self, t_ns: int) -> int | None:
        """The start (ns) of the window that this time lies in, or else of the next; None after the last."""
        return window_at(self.windows, t_ns)

    def to_plain(self) -> dict[str, Any]:
        """The sensor in plain form: lists, numbers and text, and the parts of the paths that it needs."""
        intervals = [(a / _NS, b / _NS) for a, b in self.windows]
        return {
            **{field.name: getattr(self, field.name) for field in fields(self)},
            "position": list(self.position),
            "paths": [path.cut(intervals).to_plain() for path in self.paths],
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
                "paths": tuple(map(Path.from_plain, plain["paths"])),
                "windows": tuple((a, b) for a, b in plain["windows"]),
            }
        )

    def _noise(self, purpose: str, t_ns: int) -> float:
        return normal(self.seed, self.id, self.incarnation, purpose, t_ns)
