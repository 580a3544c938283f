"""The activity and energy of a process, counted in exact integers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final, NamedTuple

from trackfield.drivers.engine.receiver import Opening, Windows, open_ns
from trackfield.link.energy import CAUSES, Power
from trackfield.link.fate import FIELD

Powers = Mapping[str, Power]
"""What each radio of a process draws, by its medium; its battery and its sensors are with that of ``FIELD``."""


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

    def minus(self, other: Activity) -> Activity:
        """The difference."""
        return Activity(*(a - b for a, b in zip(self, other, strict=True)))

    @classmethod
    def total(cls, parts: Iterable[Activity]) -> Activity:
        """All of these together."""
        return cls(*map(sum, zip(cls(), *parts, strict=True)))


NOTHING: Final = Activity()
MOST_NS: Final = 1 << 62
"""Beyond any instant of a run."""
Activities = Mapping[str, Activity]
"""Those of each radio, by its medium."""


def done(record: Mapping[str, Any]) -> dict[str, Activity]:
    """The activity of one life by medium, from its record (``Core.record``)."""
    return {medium: Activity(*parts) for medium, parts in record.get("activity", {}).items()}


def spent(record: Mapping[str, Any]) -> dict[str, Activity]:
    """The activity of all lives up to that of this record, by medium."""
    before = record.get("inherited", {})
    return {
        medium: Activity.total((own, Activity(*before.get(medium, NOTHING)))) for medium, own in done(record).items()
    }


Interval = tuple[int, int]


class Side(NamedTuple):
    """One radio: its ``activity``, how its receiver is open since when, and how it was ``before``.

    Times of sending are counted as a whole when a frame is given to the radio: those to come are ``sends``, in order;
    all up to ``done_ns`` is over and counted.
    """

    activity: Activity = NOTHING
    opening: Opening = True
    since_ns: int = -1
    before: Opening = True
    sends: tuple[Interval, ...] = ()
    done_ns: int = -1

    def after(self, from_ns: int, until_ns: int) -> Side:
        """The same, so much later."""
        side = self._counted(open_ns(self.opening, from_ns, until_ns), until_ns - from_ns)
        return side._over(until_ns) if self.sends else side

    def sent(self, at_ns: int, send_ns: int, acked_ns: int = 0) -> Side:
        """The same after it sends for so long from then on, and then hears acknowledgements: both are counted now."""
        end_ns = at_ns + send_ns + acked_ns
        if end_ns == at_ns:
            return self
        side = self._counted(-open_ns(self.opening, at_ns, end_ns), at_ns - end_ns, send_ns, acked_ns)
        return side._replace(sends=(*self.sends, (at_ns, end_ns)))

    def received(self, until_ns: int, receive_ns: int, acks_ns: int = 0) -> Side:
        """The same after it received for so long, and sent acknowledgements, until then.

        Of what it did at the same time, one thing is counted. How its receiver was open before the last switch but one
        is forgotten: what is taken from listening is no more than it listened, and so with sleep.
        """
        begin_ns = max(until_ns - receive_ns - acks_ns, self.done_ns)
        end_ns = min(until_ns, self.sends[0][0]) if self.sends else until_ns
        if end_ns <= begin_ns:
            return self
        change_ns = min(max(self.since_ns, begin_ns), end_ns)
        listened = open_ns(self.before, begin_ns, change_ns) + open_ns(self.opening, change_ns, end_ns)
        open_ahead = sum(open_ns(self.opening, max(begin, until_ns), end) for begin, end in self.sends)
        ahead = sum(end - max(begin, until_ns) for begin, end in self.sends)
        listened = max(listened, end_ns - begin_ns - max(self.activity.sleep_ns + ahead - open_ahead, 0))
        listened = min(listened, max(self.activity.listen_ns + open_ahead, 0))
        acks_ns = min(acks_ns, end_ns - begin_ns)
        side = self._counted(-listened, begin_ns - end_ns, acks_ns, end_ns - begin_ns - acks_ns)
        return side._replace(done_ns=end_ns)

    def switched(self, opening: Opening, t_ns: int) -> Side:
        """The same with its receiver open in this way from then on."""
        side = self._replace(
            opening=opening, since_ns=t_ns, before=self.before if self.since_ns == t_ns else self.opening
        )
        for begin_ns, end_ns in self.sends:
            still = max(begin_ns, t_ns), end_ns
            side = side._counted(open_ns(self.opening, *still) - open_ns(opening, *still), 0)
        return side

    def _counted(self, listen_ns: int, passed_ns: int, send_ns: int = 0, receive_ns: int = 0) -> Side:
        """With so much more time in all, of which it listened, and with this use of the radio."""
        a = self.activity
        return self._replace(
            activity=Activity(
                a.send_ns + send_ns,
                a.receive_ns + receive_ns,
                a.listen_ns + listen_ns,
                a.sleep_ns + passed_ns - listen_ns,
                a.samples,
            )
        )

    def _over(self, t_ns: int) -> Side:
        """The same without the sends that are over by then."""
        ends = [end_ns for _, end_ns in self.sends if end_ns <= t_ns]
        return self._replace(sends=self.sends[len(ends) :], done_ns=max([self.done_ns, *ends]))


class Meter(NamedTuple):
    """The radios of a process by their media, up to ``since_ns``; that of ``FIELD`` counts the readings, too."""

    sides: Mapping[str, Side]
    since_ns: int = 0

    @classmethod
    def new(cls, media: Iterable[str] = (FIELD,), since_ns: int = 0, before: Activities | None = None) -> Meter:
        """All on; ``before`` is what earlier lives did."""
        return cls({medium: Side((before or {}).get(medium, NOTHING)) for medium in media}, since_ns)

    def at(self, t_ns: int) -> Meter:
        """The same, up to a later time."""
        since_ns = self.since_ns
        if t_ns == since_ns:
            return self
        return Meter({medium: side.after(since_ns, t_ns) for medium, side in self.sides.items()}, t_ns)

    def sent(self, medium: str, at_ns: int, send_ns: int, acked_ns: int = 0) -> Meter:
        """The meter of one that sends for so long from then on, which is not over, and then hears acknowledgements."""
        side = self.sides.get(medium)
        return self if side is None else self._with(medium, side.sent(at_ns, send_ns, acked_ns))

    def received(self, medium: str, receive_ns: int, acks_ns: int = 0) -> Meter:
        """The meter of one that received for so long, and sent acknowledgements, until now."""
        side = self.sides.get(medium)
        return self if side is None else self._with(medium, side.received(self.since_ns, receive_ns, acks_ns))

    def sensed(self) -> Meter:
        """The meter after a reading of a sensor."""
        side = self.sides.get(FIELD)
        if side is None:
            return self
        a = side.activity
        return self._with(FIELD, side._replace(activity=a._replace(samples=a.samples + 1)))

    def switched(self, medium: str, opening: Opening) -> Meter:
        """The meter with this receiver open in this way from now on."""
        side = self.sides.get(medium)
        return self if side is None else self._with(medium, side.switched(opening, self.since_ns))

    @property
    def activities(self) -> dict[str, Activity]:
        """By medium."""
        return {medium: side.activity for medium, side in self.sides.items()}

    def left_fj(self, powers: Powers) -> int | None:
        """The energy left in the battery, 0 if it is overdrawn; None on mains."""
        battery = powers[FIELD].battery_fj
        if battery is None:
            return None
        return max(battery - sum(sum(s.activity.energy_fj(powers[m]).values()) for m, s in self.sides.items()), 0)

    def falls_ns(self, powers: Powers, level_fj: int) -> int | None:
        """When the battery is down to this level if nothing else happens; None: never."""
        left = self.left_fj(powers)
        if left is None:
            return None
        if left <= level_fj:
            return self.since_ns
        if any(isinstance(side.opening, Windows) for side in self.sides.values()):
            return self._falls_in_windows_ns(powers, left - level_fj)
        draw = sum(powers[m].listen_uw if side.opening else powers[m].sleep_uw for m, side in self.sides.items())
        return self.since_ns + -(-(left - level_fj) // draw) if draw else None

    def _falls_in_windows_ns(self, powers: Powers, need_fj: int) -> int | None:
        """When so much more is spent, where the power changes with the windows of one radio, or of several."""
        windows = {m: side.opening for m, side in self.sides.items() if isinstance(side.opening, Windows)}
        draw = sum(
            powers[m].listen_uw if side.opening is True else powers[m].sleep_uw for m, side in self.sides.items()
        )
        more = {m: powers[m].listen_uw - powers[m].sleep_uw for m in windows}
        if len(windows) == 1:
            ((medium, one),) = windows.items()
            return one.spent_ns(self.since_ns, need_fj, draw + more[medium], draw)
        low, high = self.since_ns, self.since_ns + 1
        while draw * (high - low) + sum(more[m] * one.within(low, high) for m, one in windows.items()) < need_fj:
            if high - low > MOST_NS:
                return None
            high = low + 2 * (high - low)
        while high - low > 1:
            middle = (low + high) // 2
            passed = middle - self.since_ns
            spent = draw * passed + sum(more[m] * w.within(self.since_ns, middle) for m, w in windows.items())
            low, high = (middle, high) if spent < need_fj else (low, middle)
        return high

    def _with(self, medium: str, side: Side) -> Meter:
        return self._replace(sides={**self.sides, medium: side})
