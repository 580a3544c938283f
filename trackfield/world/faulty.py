"""A sensor with faults: stuck, off by a bias, deaf, or babbling; a pure function of the time, as the sensor itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol

from trackfield.draw import uniform
from trackfield.sensing.readings import Ears, Heard, Reading

STUCK_DB: Final = 3.0
"""How far above its threshold the reading of a sensor is that got stuck while it heard nothing."""
BABBLE_DB: Final = 10.0
"""How far at most the readings of a babbling sensor are above its threshold."""


@dataclass(frozen=True, slots=True)
class SensorFault:
    """A fault in [``from_ns``, ``until_ns``) (None: to the end of the run); see ``Faulty``."""

    kind: str
    from_ns: int
    until_ns: int | None = None
    bias_deg: float = 0.0
    bias_db: float = 0.0

    def lasts(self, t_ns: int) -> bool:
        """Whether it is present at this time."""
        return self.from_ns <= t_ns and not self.over(t_ns)

    def over(self, t_ns: int) -> bool:
        """Whether it has ended by this time."""
        return self.until_ns is not None and self.until_ns <= t_ns


class Placed(Ears, Protocol):
    """A sensor at a node, in one of its lives, with the keys of its draws."""

    @property
    def id(self) -> str:
        """The id of its node."""
        ...

    @property
    def seed(self) -> int:
        """The seed of the run."""
        ...

    @property
    def incarnation(self) -> int:
        """Which life of its node it is."""
        ...


@dataclass(frozen=True, slots=True)
class Faulty:
    """``sensor`` with ``faults``; of several at a time the first counts, but all biases add up.

    - ``stuck``: repeats the reading at its start; if nothing was heard then, one from a random direction,
      somewhat above ``threshold_db``;
    - ``babble``: at every instant a reading from a random direction, above the threshold by up to 10 dB;
    - ``deaf``: hears nothing;
    - ``bias``: readings are off by ``bias_deg`` and ``bias_db``.

    A sensor that is stuck or babbles is awake all the time, target or not.
    """

    sensor: Placed
    faults: tuple[SensorFault, ...]
    threshold_db: float

    def sample(self, t_ns: int) -> Heard | Reading | None:
        """The reading at this true time; None if nothing is heard."""
        lasting = [fault for fault in self.faults if fault.lasts(t_ns)]
        for fault in lasting:
            match fault.kind:
                case "stuck":
                    return self.sensor.sample(fault.from_ns) or self._invented("stuck", fault.from_ns, STUCK_DB)
                case "babble":
                    return self._invented("babble", t_ns, BABBLE_DB * self._draw("babble", "level", t_ns))
                case "deaf":
                    return None
        heard = self.sensor.sample(t_ns)
        if not isinstance(heard, Heard) or not lasting:
            return heard
        level_db = heard.level_db + sum(fault.bias_db for fault in lasting)
        return Heard.at(level_db, heard.bearing_deg + sum(fault.bias_deg for fault in lasting))

    def next_window(self, t_ns: int) -> int | None:
        """See ``AcousticSensor.next_window``."""
        awake = [one.from_ns for one in self.faults if one.kind in ("stuck", "babble") and not one.over(t_ns)]
        window = self.sensor.next_window(t_ns)
        return min(awake if window is None else (*awake, window), default=None)

    def _invented(self, kind: str, t_ns: int, above_db: float) -> Heard | Reading | None:
        return Heard.at(self.threshold_db + above_db, 360.0 * self._draw(kind, "bearing", t_ns))

    def _draw(self, kind: str, what: str, t_ns: int) -> float:
        return uniform(self.sensor.seed, self.sensor.id, self.sensor.incarnation, kind, what, t_ns)


def with_faults(sensor: Placed, faults: Sequence[Mapping[str, Any]], threshold_db: float) -> Ears:
    """The sensor with these faults (the plain forms of ``SensorFault``); the sensor itself if there are none.

    ``threshold_db`` is the level from which its node reports.
    """
    return Faulty(sensor, tuple(SensorFault(**fault) for fault in faults), threshold_db) if faults else sensor
