"""Recorded reports of sensors whose places are known, of a target whose path is known, as arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import dist
from pathlib import Path as FilePath
from typing import Final

import numpy as np

from launcher.calibrate.samples import Bools, Floats, Ints
from trackfield.errors import ScenarioError
from trackfield.scenario.packaged import or_packaged
from trackfield.scenario.places import Point, read_places
from trackfield.words import quoted
from trackfield.world.path import Path
from trackfield.world.recording import APART_S, Recording, read_recording

LEAST_OF_SENSOR: Final = 10
"""Of a sensor with fewer reports nothing can be said."""
LEAST_INSTANTS: Final = 40
"""At fewer instants nothing can be said of time."""
_NS: Final = 1e9
OF_EACH: Final = ("recording", "sensor", "t_s", "distance_m", "value", "instant")
"""What there is of each report."""
Row = tuple[float, int, float, float]
"""(time, sensor, distance, number)"""


@dataclass(frozen=True)
class Reports:
    """Reports (R,) in the order of recording and time.

    ``recording`` and ``sensor`` are indices of ``files`` and ``ids``; ``t_s`` are the times of each recording in
    seconds, ``distance_m`` how far away the target then was, ``value`` what was reported. ``instant`` numbers the
    instants, of all recordings: reports so soon after each other are of one.
    """

    files: tuple[str, ...]
    ids: tuple[str, ...]
    recording: Ints
    sensor: Ints
    t_s: Floats
    distance_m: Floats
    value: Floats
    instant: Ints
    away_m: Floats
    """(instants, sensors): how far away the target was at each instant from each sensor."""

    @cached_property
    def heard(self) -> Bools:
        """(instants, sensors): whether there is a report."""
        found = np.zeros(self.away_m.shape, bool)
        found[self.instant, self.sensor] = True
        return found

    def only(self, some: Ints) -> Reports:
        """The reports at these indices."""
        each = {name: getattr(self, name)[some] for name in OF_EACH}
        return replace(self, **each)


def reports_of(files: Sequence[FilePath], sensors: FilePath) -> Reports:
    """What is in these recordings, as far as it is known where the target was; ``sensors`` has the sensors' places.

    Raises ``ScenarioError`` for a file that cannot be used, for a sensor without a place and for too few reports.
    """
    if twice := next((file for file in files if files.count(file) > 1), None):
        raise ScenarioError("is given twice", file=str(twice), expected="each recording once")
    found, _ = read_places(or_packaged(sensors), None, None)
    places = {id: (x, y) for id, x, y in found}
    parts = [_rows(read_recording(or_packaged(file)), places, sensors) for file in files]
    rows = [row for part in parts for row in part]
    _check_count(rows, tuple(places), files)
    t_s, sensor, distance, value = np.array(rows).T
    recording = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    instant = _instants(recording, t_s)
    if instant[-1] + 1 < LEAST_INSTANTS:
        what = f"sensors report at {instant[-1] + 1} instants only"
        raise ScenarioError(what, file=_all(files), expected=f"at least {LEAST_INSTANTS}")
    firsts = np.flatnonzero(np.diff(instant, prepend=-1))
    away = _away([str(file) for file in files], recording[firsts], t_s[firsts], list(places.values()))
    names = tuple(file.name for file in files)
    return Reports(names, tuple(places), recording, sensor.astype(np.int64), t_s, distance, value, instant, away)


def _rows(recording: Recording, places: Mapping[str, Point], sensors: FilePath) -> list[Row]:
    """The reports of a recording in order of time."""
    if len(recording.columns) != 1:
        what = f"has {len(recording.columns)} columns of numbers ({', '.join(recording.columns)})"
        expected = "one, besides t_s, sensor, x_m and y_m"
        raise ScenarioError(what, file=recording.file, expected=expected)
    if unknown := [id for id in recording.readings if id not in places]:
        what = f"has reports of {quoted(unknown[0])}, whose place is not in {sensors.name}"
        raise ScenarioError(what, file=recording.file, expected=f"ids of {sensors.name}, like {next(iter(places))}")
    truth = recording.truth
    if truth is None:
        what = "does not say where the target was"
        raise ScenarioError(what, file=recording.file, expected="the columns x_m and y_m, known in at least two rows")
    number, rows = {id: i for i, id in enumerate(places)}, list[Row]()
    for id, readings in recording.readings.items():
        for t_ns, (value, *_) in readings:
            place = _place(truth, t_ns / _NS)
            if place is not None and not truth.interpolated(t_ns / _NS):
                rows.append((t_ns / _NS, number[id], dist(place, places[id]), value))
    return sorted(rows)


def _place(truth: Path, t_s: float) -> Point | None:
    """Where the target is; None where that is not known. Until ``APART_S`` after the last fix it is there."""
    late_s = t_s - truth.end_s
    state = truth.at(truth.end_s if 0.0 < late_s < APART_S else t_s)
    return None if state is None else state[:2]


def _check_count(rows: Sequence[Row], ids: Sequence[str], files: Sequence[FilePath]) -> None:
    counts = np.bincount([sensor for _, sensor, *_ in rows], minlength=len(ids))
    if counts.min() < LEAST_OF_SENSOR:
        i, few = int(counts.argmin()), int((counts < LEAST_OF_SENSOR).sum())
        more = f", and too few of {few - 1} more" if few > 1 else ""
        what = f"{counts[i]} reports of {quoted(ids[i])} while it is known where the target is{more}"
        expected = f"at least {LEAST_OF_SENSOR} of each sensor, or a file of sensors without it"
        raise ScenarioError(what, file=_all(files), expected=expected)


def _all(files: Sequence[FilePath]) -> str:
    return ", ".join(map(str, files))


def _instants(recording: Ints, t_s: Floats) -> Ints:
    """The number of each report's instant: a new one begins ``APART_S`` after the last one did."""
    found, begin, number = np.empty(len(t_s), np.int64), (-1, 0.0), -1
    for i, (of, t) in enumerate(zip(recording.tolist(), t_s.tolist(), strict=True)):
        if of != begin[0] or t - begin[1] >= APART_S:
            begin, number = (of, t), number + 1
        found[i] = number
    return found


def _away(files: Sequence[str], recording: Ints, t_s: Floats, places: Sequence[Point]) -> Floats:
    """How far away (instants, sensors) the target was; infinite where that is not known."""
    paths = [read_recording(or_packaged(FilePath(file))).truth for file in files]
    found = np.full((len(t_s), len(places)), np.inf)
    for i, (of, t) in enumerate(zip(recording.tolist(), t_s.tolist(), strict=True)):
        path = paths[of]
        here = None if path is None else _place(path, t)
        if here is not None:
            found[i] = [dist(here, place) for place in places]
    return found
