"""The activity and energy of a process, counted in exact integers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final, NamedTuple

from trackfield.link.energy import CAUSES, Power


class Activity(NamedTuple):
    """Durations (ns) of sending, receiving, listening only and sleeping, and the number of sensor readings."""

    send_ns: int = 0
    receive_ns: int = 0
    listen_ns: int = 0
    sleep_ns: int = 0
    samples: int = 0

    def energy_fj(self, power: Power) -> dict[str, int]:
        """The energy of this activity on this device, by cause (fJ)."""
        rates = (power.send_uw, power.receive_uw, power.listen_uw, power.sleep_uw, power.sample_fj)
        return {cause: rate * amount for cause, rate, amount in zip(CAUSES, rates, self, strict=True)}

    @classmethod
    def total(cls, parts: Iterable[Activity]) -> Activity:
        """All of these together."""
        return cls(*map(sum, zip(cls(), *parts, strict=True)))


NOTHING: Final = Activity()


def spent(record: Mapping[str, Any]) -> Activity:
    """The activity of all lives up to that of this record (``Core.record``)."""
    return Activity.total(Activity(*record[part]) for part in ("activity", "inherited"))


class Meter(NamedTuple):
    """The ``activity`` of a process up to ``since_ns``, and whether its receiver is on from then on."""

    activity: Activity = Activity()
    since_ns: int = 0
    on: bool = True

    def at(self, t_ns: int) -> Meter:
        """The same, up to a later time."""
        passed = t_ns - self.since_ns
        return Meter(self._rest(passed), t_ns, self.on) if passed else self

    def used(self, *, send_ns: int = 0, receive_ns: int = 0, samples: int = 0) -> Meter:
        """The meter after sending and receiving for these durations, which do not count as listening or sleeping."""
        a = self._rest(-send_ns - receive_ns)
        done = a._replace(
            send_ns=a.send_ns + send_ns, receive_ns=a.receive_ns + receive_ns, samples=a.samples + samples
        )
        return self._replace(activity=done)

    def left_fj(self, power: Power) -> int | None:
        """The energy left in the battery, 0 if it is overdrawn; None on mains."""
        if power.battery_fj is None:
            return None
        return max(power.battery_fj - sum(self.activity.energy_fj(power).values()), 0)

    def falls_ns(self, power: Power, level_fj: int) -> int | None:
        """When the battery is down to this level if nothing else happens; None: never."""
        left, draw = self.left_fj(power), power.listen_uw if self.on else power.sleep_uw
        if left is None or (left > level_fj and not draw):
            return None
        return self.since_ns + (-(-(left - level_fj) // draw) if left > level_fj else 0)

    def _rest(self, passed: int) -> Activity:
        a = self.activity
        if self.on:
            return a._replace(listen_ns=a.listen_ns + passed)
        return a._replace(sleep_ns=a.sleep_ns + passed)
