"""The events of a run, once it is over: who heard a target, the lines that ECPA chose from, fixes, and sound."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import zip_longest
from math import hypot, nan
from typing import Any, Final, NamedTuple

import numpy as np
import rerun as rr

from launcher.heard import RANKS, Event, Line, Report, Sound
from launcher.records import FieldInfo
from launcher.timeline import look, rows
from launcher.timeline.look import path as entity
from launcher.timeline.scene import Add, Points, rings
from trackfield.role import NS

LOG: Final = "/passes"
"""The entity of what happens, in words."""
HELD_NS: Final = 4 * NS
"""For so long after it was published an event is drawn."""
COMING_M: Final = 15.0
"""So far beyond the sensors lines are drawn."""
_PART_NS: Final = NS // 200
"""The waveform is drawn by its least and greatest value in each of such times."""
LONE: Final = 0xF2A93BFF
HEARD: Final = 0x4FC0F0FF
MARKS: Final = {"closest point of approach": look.LOST, "triggered": look.LATE}
_FIELD: Final = "/field/event"
Static = Callable[..., None]


class _Drawn(NamedTuple):
    """Something that is drawn from ``begin_ns`` until ``end_ns``."""

    begin_ns: int
    end_ns: int
    what: Any


class Passes:
    """Hands events and sounds to ``add``."""

    def __init__(self, info: FieldInfo, add: Add, static: Static) -> None:
        self._info, self._add, self._static = info, add, static
        self._places = {place.id: (place.x, place.y) for place in info.places}

    def events(self, events: Sequence[Event]) -> None:
        """All events of a run."""
        for event in events:
            self._tell(event)
        self._draw("sensors", rows.named_dots, list(self._sensors(events)), _dots)
        candidates = [
            _Drawn(event.end_ns, event.end_ns + HELD_NS, self._through(event, line))
            for event in events
            for line in (event.tried.lines if event.tried else ())
        ]
        self._draw("candidates", rows.strips, candidates, _lines)
        for tracker in dict.fromkeys(one.tracker for event in events for one in event.outcomes):
            self._fixes(tracker, events)

    def _fixes(self, tracker: str, events: Sequence[Event]) -> None:
        """The line of each fix of a tracker, and where it was published."""
        colour = look.tracker_colour(self._info, tracker)
        self._static(entity("field", "event", tracker, "line"), look.line_style(colour, 2.5, order=42))
        self._static(entity("field", "event", tracker, "fix"), look.line_style(colour, 2.0, order=43))
        found = [
            (event, one, one.line)
            for event in events
            for one in event.outcomes
            if one.tracker == tracker and one.line is not None
        ]
        spans = [(one.told_ns, one.told_ns + HELD_NS) for _, one, _ in found]
        ways = [_Drawn(*span, self._through(event, line)) for span, (event, _, line) in zip(spans, found, strict=True)]
        self._draw(f"{tracker}/line", rows.strips, ways, _lines, entity("field", "event", tracker, "line"))
        ellipses = [
            _Drawn(*span, rings(np.array([line[:2]]), one.covariance)[0])
            for span, (_, one, line) in zip(spans, found, strict=True)
        ]
        self._draw(f"{tracker}/fix", rows.strips, ellipses, _rings, entity("field", "event", tracker, "fix"))

    def _sensors(self, events: Sequence[Event]) -> Iterator[_Drawn]:
        """Each from when it heard the target loudest; the lone one is marked once ECPA can choose."""
        for event in events:
            over_ns = event.end_ns + HELD_NS
            for report in event.reports:
                if report.sensor not in self._places:
                    continue
                at, lone = self._places[report.sensor], event.tried is not None and event.tried.lone == report.sensor
                begin_ns = min(report.at_ns, event.end_ns)
                yield _Drawn(begin_ns, event.end_ns if lone else over_ns, (at, HEARD, report.sensor))
                if lone:
                    yield _Drawn(event.end_ns, over_ns, (at, LONE, f"{report.sensor} = n0"))

    def _through(self, event: Event, line: Line) -> Points:
        """A piece (2, 2) of a line across the surroundings of the sensors of an event."""
        at = [self._places[one.sensor] for one in event.reports if one.sensor in self._places]
        middle = np.mean(at, axis=0) if at else np.array(line[:2])
        reach_m = float(np.ptp(np.array(at or [(0.0, 0.0)]), axis=0).max()) + COMING_M
        along = np.array(line[2:]) / max(hypot(*line[2:]), 1e-9)
        nearest = np.array(line[:2]) + ((middle - line[:2]) @ along) * along
        return np.array([nearest - reach_m * along, nearest + reach_m * along])

    def _draw(
        self,
        part: str,
        columns: Callable[[list[Any]], rows.Columns],
        found: Sequence[_Drawn],
        together: Callable[[list[Any]], Any],
        path: str = "",
    ) -> None:
        """A picture at each instant at which something begins or ends."""
        for t_ns in sorted({end for one in found for end in (one.begin_ns, one.end_ns)}):
            now = [one.what for one in found if one.begin_ns <= t_ns < one.end_ns]
            self._add(path or f"{_FIELD}/{part}", columns, t_ns, together(now))

    # --- words ----------------------------------------------------------------------------------------------------

    def _tell(self, event: Event) -> None:
        for one in event.reports:
            self._log(one.at_ns, _heard(one))
        for outcome in event.outcomes:
            count = len(event.reports)
            fix = "a fix, " if outcome.line is not None else ""
            said = f"{event.head}, {outcome.tracker}: {fix}{outcome.text}" + (f", of {count} reports" if count else "")
            self._log(outcome.told_ns, said, "INFO" if outcome.line is not None else "WARN")

    def _log(self, t_ns: int, text: str, level: str = "INFO") -> None:
        self._add(LOG, rows.texts, t_ns, (text, level, look.LEVELS[level]))

    # --- sound ----------------------------------------------------------------------------------------------------

    def sounds(self, rank: str, sounds: Sequence[Sound]) -> None:
        """What the ``rank`` of the sensors of each event heard; where two are heard at a time, one ends amid that."""
        ordered, begin_ns = sorted(sounds, key=lambda sound: sound.first_ns), 0
        for sound, after in zip_longest(ordered, ordered[1:]):
            end_ns = _end_ns(sound) if after is None else _amid(sound, after)
            self._levels(rank, sound, begin_ns, end_ns)
            self._waveform(rank, sound, begin_ns, end_ns)
            self._marks(sound)
            begin_ns = end_ns

    def _levels(self, rank: str, sound: Sound, begin_ns: int, end_ns: int) -> None:
        t_ns = sound.first_ns + np.rint(sound.levels[:, 0] * NS)
        for at_ns, heard, fitted in np.column_stack((t_ns, sound.levels[:, 1:])).tolist():
            if begin_ns <= at_ns < end_ns:
                self._add(entity("plots", "level", rank), rows.scalars, int(at_ns), (heard, fitted))
        self._add(entity("plots", "level", rank), rows.scalars, end_ns, (nan, nan))

    def _waveform(self, rank: str, sound: Sound, begin_ns: int, end_ns: int) -> None:
        size = _PART_NS * sound.rate // NS
        parts = sound.samples[: len(sound.samples) // size * size].reshape(-1, size)
        for number, (low, high) in enumerate(zip(parts.min(axis=1), parts.max(axis=1), strict=True)):
            at_ns = sound.first_ns + number * _PART_NS
            if begin_ns <= at_ns < end_ns:
                value = float(low if number % 2 else high)
                self._add(entity("plots", "waveform", rank), rows.scalars, at_ns, (value,))
        self._add(entity("plots", "waveform", rank), rows.scalars, end_ns, (nan,))

    def _marks(self, sound: Sound) -> None:
        """Points in the plot of the levels, on the curve; and words."""
        for (name, _), at_ns in zip(MARKS.items(), (sound.peak_ns, sound.known_ns), strict=True):
            if at_ns is None or not len(sound.levels):
                continue
            nearest = int(np.abs(sound.levels[:, 0] - (at_ns - sound.first_ns) / NS).argmin())
            self._add(entity("plots", "level", name), rows.scalars, at_ns, (float(sound.levels[nearest, 2]),))
            if name == "triggered":
                self._log(at_ns, f"{sound.sensor}: the detector tells of a pass")


def styles(info: FieldInfo) -> Iterator[tuple[str, *tuple[rr.AsComponents, ...]]]:
    """How they look; nothing where sensors hear nothing."""
    if not info.hears:
        return
    yield f"{_FIELD}/sensors", look.point_style(None, 6.0, order=41), rr.Points2D.from_fields(show_labels=True)
    yield f"{_FIELD}/candidates", look.line_style(look.RING, 1.2, order=19)
    if not info.listens:
        return
    for rank, colours in zip(RANKS, ((0x56B4E9FF, 0xFFFFFFFF), (0x3C6E5AFF, 0x8FE0B0FF)), strict=True):
        names = [f"{rank}, level [dB]", f"{rank}, fit"]
        yield entity("plots", "level", rank), rr.SeriesLines(colors=list(colours), names=names, widths=[1.0, 2.0])
        yield entity("plots", "waveform", rank), rr.SeriesLines(colors=colours[0], names=rank, widths=1.0)
    for name, colour in MARKS.items():
        yield entity("plots", "level", name), rr.SeriesPoints(colors=colour, names=name, marker_sizes=5.0)


def _end_ns(sound: Sound) -> int:
    return sound.first_ns + len(sound.samples) * NS // sound.rate


def _amid(one: Sound, after: Sound) -> int:
    """When one sound is no longer drawn, as another comes after it."""
    end_ns = _end_ns(one)
    return (end_ns + after.first_ns) // 2 if after.first_ns < end_ns else end_ns


def _dots(found: list[Any]) -> tuple[Points, list[int], list[str]]:
    at = np.reshape([one for one, _, _ in found], (-1, 2))
    return at, [colour for _, colour, _ in found], [name for _, _, name in found]


def _lines(found: list[Any]) -> Points:
    return np.reshape(found, (-1, 2, 2))


def _rings(found: list[Any]) -> Points:
    return np.reshape(found, (-1, 33, 2))


def _heard(report: Report) -> str:
    return f"{report.sensor} hears a target loudest: {report.strength_db:.1f} dB, {report.width_s:.2g} s wide"
