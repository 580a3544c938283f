"""A sensor with faults: stuck, off by a bias, deaf, or babbling; a pure function of the time, as the sensor itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

from trackfield.sensing.readings import Ears, Reading
from trackfield.world.placed import Placed

_NS: Final = 1_000_000_000


@dataclass(frozen=True, slots=True)
class SensorFault:
    """A fault in [``from_ns``, ``until_ns``) (None: to the end of the run); see ``Faulty``.

    ``bias`` is added to the numbers of a reading, in the units of its kind.
    """

    kind: str
    from_ns: int
    until_ns: int | None = None
    bias: Sequence[float] = ()

    def lasts(self, t_ns: int) -> bool:
        """Whether it is present at this time."""
        return self.from_ns <= t_ns and not self.over(t_ns)

    def over(self, t_ns: int) -> bool:
        """Whether it has ended by this time."""
        return self.until_ns is not None and self.until_ns <= t_ns


@dataclass(frozen=True, slots=True)
class Faulty:
    """``sensor`` with ``faults``; of several at a time the first counts, but all biases add up.

    - ``stuck``: repeats the reading at its start; if nothing was sensed then, one that its kind invents, or that of a
      target at a random place in range;
    - ``babble``: such a reading at every instant, each time another;
    - ``deaf``: senses nothing;
    - ``bias``: readings are off.

    A sensor that is stuck or babbles is awake all the time, target or not.
    """

    sensor: Placed
    faults: tuple[SensorFault, ...]

    def sample(self, t_ns: int) -> Reading | None:
        """The reading at this true time; None if nothing is sensed."""
        lasting = [fault for fault in self.faults if fault.lasts(t_ns)]
        for fault in lasting:
            match fault.kind:
                case "stuck":
                    return self.sensor.latest(fault.from_ns) or self._invented("stuck", fault.from_ns)
                case "babble":
                    return self._invented("babble", t_ns)
                case "deaf":
                    return None
        reading = self.sensor.sample(t_ns)
        if reading is None or not lasting:
            return reading
        off = map(sum, zip(*(fault.bias for fault in lasting), strict=True))
        return self.sensor.read([value + by for value, by in zip(reading.values, off, strict=True)], t_ns)

    def next_window(self, t_ns: int) -> int | None:
        """See ``Placed.next_window``; one that reports by itself babbles once a second."""
        window = self.sensor.next_window(t_ns)
        if self.sensor.kind.rhythm == "events":
            babbles = (one for one in self.faults if one.kind == "babble")
            times = [max(one.from_ns, t_ns - (t_ns - one.from_ns) % _NS + _NS) for one in babbles]
            times = [at for at in times if any(one.kind == "babble" and one.lasts(at) for one in self.faults)]
            return min(times if window is None else (*times, window), default=None)
        awake = [one.from_ns for one in self.faults if one.kind in ("stuck", "babble") and not one.over(t_ns)]
        return min(awake if window is None else (*awake, window), default=None)

    def _invented(self, fault: str, t_ns: int) -> Reading | None:
        sensor = self.sensor
        if sensor.kind.invented is None:
            return sensor.elsewhere(fault, t_ns)
        draw = partial(_drawn, sensor, fault, t_ns)
        values = sensor.kind.invented(fault, sensor.threshold, draw)
        return None if values is None else sensor.read(sensor.kind.biased(values, sensor.id), t_ns)


def _drawn(sensor: Placed, fault: str, t_ns: int, what: str) -> float:
    return sensor.uniform(fault, what, t_ns)


def with_faults(sensor: Placed, faults: Sequence[Mapping[str, Any]]) -> Ears:
    """The sensor with these faults (the plain forms of ``SensorFault``); the sensor itself if there are none."""
    return Faulty(sensor, tuple(SensorFault(**fault) for fault in faults)) if faults else sensor
