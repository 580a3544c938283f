"""Reports of passes gathered into events: a target passes a cluster of sensors, and each reports when it was nearest.

Yang et al., section 3: the cluster head collects the reports of an event before it solves for the path. Which reports
belong together is known by their times. A report comes a second or more after its CPA (closest point of approach), with
the step that follows. So an event is over when no report came for ``close_s``, as then no CPA followed its last one for
so long. It may turn out later that one did: the event then goes on, and is over once more.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from trackfield.filters.types import Reports

TWICE_S: Final = 2.0
"""Two reports of a sensor whose CPAs are less than this apart are of the same pass."""
_SDS: Final = 3
"""The numbers of a reading before the standard deviations, if it has any: time, strength, width."""


class Pass(NamedTuple):
    """A report of a pass by ``sensor``, which is at ``x_m``, ``y_m``.

    ``time_s`` is that of its CPA, as the sensor heard it, relative to the instant of the state that holds the report,
    so below 0. ``strength_db`` is the amplitude then, and ``width_s`` the width of the pulse; 0: not known. The
    standard deviations are NaN unless the sensor said them.
    """

    sensor: str
    x_m: float
    y_m: float
    time_s: float
    strength_db: float
    width_s: float
    time_sd_s: float = float("nan")
    strength_sd_db: float = float("nan")


class Event(NamedTuple):
    """The ``passes`` of an event, the earliest first; the last report came with a step ``quiet_s`` ago.

    ``over``: it has ended, and goes on only if a further report belongs to it; ``again``: as it has done.
    """

    passes: tuple[Pass, ...] = ()
    quiet_s: float = 0.0
    over: bool = False
    again: bool = False


Fits = Callable[[tuple[Pass, ...]], bool]
"""Whether reports are those of one pass."""


class Ended(NamedTuple):
    """An event that is over, with its ``passes``; ``again``: as it was before, with fewer of them."""

    passes: tuple[Pass, ...]
    again: bool


class Gathered(NamedTuple):
    """After a step: the event that is open, or the last one, and those that ended."""

    event: Event
    ended: tuple[Ended, ...]


@dataclass(frozen=True)
class Events:
    """Gathers reports; for the options see ``Solver``. There are ``sensors`` of them, 0: not known."""

    close_s: float
    apart_s: float
    least: int
    most: int
    sensors: int = 0

    def step(self, event: Event, passes: tuple[Pass, ...], dt: float, fits: Fits) -> Gathered:
        """The event ``dt`` seconds later, with the ``passes`` that were reported for this step."""
        aged = tuple(one._replace(time_s=one.time_s - dt) for one in event.passes)
        event, ended = event._replace(passes=aged, quiet_s=event.quiet_s + dt), list[Ended]()
        for one in sorted(passes, key=_when):
            event = self._taken(event, one, fits, ended)
            if len(event.passes) >= self._all:
                event = _ended(event, ended)
        waits_s = self.close_s if len(event.passes) >= self.least else max(self.apart_s, self.close_s)
        if event.passes and event.quiet_s >= waits_s:
            event = _ended(event, ended)
        return Gathered(event, tuple(ended))

    @property
    def _all(self) -> int:
        """How many reports an event has at most."""
        return min(self.most, self.sensors) if self.sensors else self.most

    def _taken(self, event: Event, one: Pass, fits: Fits, ended: list[Ended]) -> Event:
        """The event with a further report, or the next one, if the report begins that; this one has then ``ended``."""
        if not event.passes:
            return Event((one,))
        before = [other for other in event.passes if other.sensor == one.sensor]
        full = event.over and len(event.passes) >= self._all
        after_s = one.time_s - event.passes[-1].time_s
        if any(abs(other.time_s - one.time_s) < TWICE_S for other in before) or (full and after_s <= 0.0):
            return event
        if one.time_s < event.passes[0].time_s - self.apart_s:  # of an event before
            return event
        whole = bool(before) and (event.over or (len(event.passes) >= self.least and fits(event.passes)))
        if full or whole or after_s > self.apart_s:
            _ended(event, ended)
            return Event((one,))
        # a sensor that was passed again, before there was an event: its report before was a false one
        others = (other for other in event.passes if other not in before)
        return Event(tuple(sorted((*others, one), key=_when)), again=event.over or event.again)


def _when(one: Pass) -> tuple[float, str]:
    """The order of reports: by their times."""
    return one.time_s, one.sensor


def _ended(event: Event, ended: list[Ended]) -> Event:
    """The event once it is over: one of those that ``ended``, unless it was before."""
    if not event.over:
        ended.append(Ended(event.passes, event.again))
    return event._replace(over=True)


def passes_of(reports: Reports) -> tuple[Pass, ...]:
    """The reports of a step one by one; their readings are (time s, strength dB, width s), sds behind them if any."""
    (readings,) = reports.readings
    rows = zip(reports.sensors, reports.positions.tolist(), readings.values.tolist(), strict=True)
    return tuple(Pass(sensor, *place, *row[:_SDS], *row[_SDS:]) for sensor, place, row in rows)


def mean_time_s(passes: tuple[Pass, ...]) -> float:
    """The mean of the times of reports."""
    return float(np.mean([one.time_s for one in passes]))
