"""A user's own sensor at a node, and its faults: a pure function of the time, like the acoustic one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import cos, isfinite, sin, sqrt, tau
from typing import Any, Final

from trackfield.draw import normal, uniform
from trackfield.errors import RunFailed
from trackfield.sensing.kinds import Sensor, make_sensor
from trackfield.sensing.readings import Ears, Reading, Window, window_at
from trackfield.world.faulty import Faulty, SensorFault
from trackfield.world.path import Path, State

_NS: Final = 1_000_000_000
_MOST: Final = 10**15
"""The largest number of a report (docs/wire.md)."""


@dataclass(frozen=True, slots=True)
class PlacedSensor:
    """The ``sensor`` of node ``id`` at ``position`` (x, y in metres), and the targets that it may measure.

    ``windows`` hold all times at which any target may be within its range, in order and disjoint; the ``paths`` are
    only used within them. Its noise is drawn for every instant.
    """

    id: str
    position: tuple[float, float]
    paths: tuple[Path, ...]
    windows: tuple[Window, ...]
    sensor: Sensor
    seed: int
    incarnation: int = 0

    def sample(self, t_ns: int) -> Reading | None:
        """The reading of the nearest target at this true time; None if none is in range, or the sensor misses it."""
        there = [state for path in self.paths if (state := path.at(t_ns / _NS)) is not None]
        nearest = min(there, key=self._squared_m2, default=None)
        if nearest is None or self._squared_m2(nearest) > self.sensor.range_m**2:
            return None
        return self._reading(nearest, "reading", t_ns)

    def next_window(self, t_ns: int) -> int | None:
        """See ``AcousticSensor.next_window``."""
        return window_at(self.windows, t_ns)

    def elsewhere(self, purpose: str, t_ns: int) -> Reading | None:
        """The reading of a target at rest at a random place in range, drawn for each purpose and instant."""
        key = (self.id, self.incarnation, purpose)
        r = self.sensor.range_m * sqrt(uniform(self.seed, *key, "distance", t_ns))
        angle = tau * uniform(self.seed, *key, "bearing", t_ns)
        x, y = self.position
        return self._reading((x + r * sin(angle), y + r * cos(angle), 0.0, 0.0), purpose, t_ns)

    def _squared_m2(self, target: State) -> float:
        """The square of the distance to a target."""
        dx, dy = target[0] - self.position[0], target[1] - self.position[1]
        return dx * dx + dy * dy

    def _reading(self, target: State, purpose: str, t_ns: int) -> Reading | None:
        m = len(self.sensor.resolution)
        normals = tuple(normal(self.seed, self.id, self.incarnation, purpose, i, t_ns) for i in range(m))
        values = self.sensor.simulate(target, self.position, normals)
        if values is None:
            return None
        if len(values) == m and all(map(isfinite, values)):
            steps = tuple(round(value / step) for value, step in zip(values, self.sensor.resolution, strict=True))
            if max(map(abs, steps)) <= _MOST:
                return Reading(steps)
        what = f"the sensor of {self.id}, at {t_ns / _NS:g} s: simulate returned {values!r}"
        raise RunFailed(f"{what}; expected None, or {m} numbers of at most {_MOST:.0e} steps of their resolution")


class FaultyOwn(Faulty):
    """As ``Faulty``; stuck without a measurement, or babbling, it reads a target at a random place in range.

    A bias in degrees and dB has no meaning for it.
    """

    __slots__ = ()
    sensor: PlacedSensor

    def _invented(self, kind: str, t_ns: int, above_db: float) -> Reading | None:
        return self.sensor.elsewhere(kind, t_ns)


def plain(placed: PlacedSensor, kind: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """The plain form of a sensor, for ``own_ears``: lists, numbers and text."""
    intervals = [(a / _NS, b / _NS) for a, b in placed.windows]
    return {
        "kind": kind,
        "options": dict(options),
        "id": placed.id,
        "position": list(placed.position),
        "paths": [path.cut(intervals).to_plain() for path in placed.paths],
        "windows": [list(window) for window in placed.windows],
        "seed": placed.seed,
        "incarnation": placed.incarnation,
    }


def own_ears(plain: Mapping[str, Any], faults: Sequence[Mapping[str, Any]]) -> Ears:
    """The sensor of this plain form with these faults (the plain forms of ``SensorFault``)."""
    x, y = plain["position"]
    placed = PlacedSensor(
        plain["id"],
        (x, y),
        tuple(map(Path.from_plain, plain["paths"])),
        tuple((a, b) for a, b in plain["windows"]),
        make_sensor(plain["kind"], plain["options"]),
        plain["seed"],
        plain["incarnation"],
    )
    return FaultyOwn(placed, tuple(SensorFault(**fault) for fault in faults), 0.0) if faults else placed
