"""The recordings that a scenario's sensors play, on the times of a run."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from functools import partial
from pathlib import Path as FilePath
from typing import Final

from trackfield.errors import ScenarioError, together
from trackfield.scenario.paths import PathSection
from trackfield.scenario.scenario import Scenario
from trackfield.scenario.sensors import SensorSection
from trackfield.words import quoted
from trackfield.world.placed import Played
from trackfield.world.recording import Recording, Start, read_recording
from trackfield.world.windows import Windows

_NS: Final = 1_000_000_000


def recordings_of(sections: Mapping[str, SensorSection]) -> dict[str, Recording]:
    """The recordings by the names of the kinds that have one.

    Raises ``ScenarioError`` for a file that cannot be used, and for one that does not have the numbers of its kind.
    """
    played = {name: section for name, section in sections.items() if section.plays}
    found = together(partial(_read, name, section) for name, section in played.items())
    return dict(zip(played, found, strict=True))


def _read(name: str, section: SensorSection) -> Recording:
    recording, kind = read_recording(FilePath(str(section.recording))), section.sensing
    if len(recording.columns) != kind.n:
        has = f"{len(recording.columns)} columns of numbers ({', '.join(recording.columns)})"
        units = ", ".join(unit or "a number" for unit in kind.units)
        what = f"has {has}, and a report of kind '{name}' has {kind.n}"
        raise ScenarioError(what, file=recording.file, expected=f"besides times, sensors and places: {units}")
    return recording


def plays_of(
    scenario: Scenario,
    recordings: Mapping[str, Recording],
    kinds: Mapping[str, frozenset[int]],
    ids: Sequence[str],
    origin_ns: int,
) -> dict[str, tuple[Played, ...]]:
    """What sensors play, by id. Raises ``ScenarioError`` as ``_played`` does."""
    if not recordings:
        return {}
    start = _start_of(scenario.keyed_targets, tuple(recordings.values()), scenario.step_s)
    own = {name: [ids[i] for i in sorted(kinds.get(name, ()))] for name in recordings}
    parts = together(partial(_played, one, start, origin_ns, own[name], ids) for name, one in recordings.items())
    return {id: readings for part in parts for id, readings in part.items()}


def spell(readings: Sequence[Played]) -> Windows:
    """From the first to the last."""
    return ((readings[0][0], readings[-1][0]),) if readings else ()


def _played(
    recording: Recording, start: Start, origin_ns: int, ids: Collection[str], field: Collection[str]
) -> dict[str, tuple[Played, ...]]:
    """What the sensors of these ``ids`` play, in ns since the beginning of a run whose first step is at ``origin_ns``.

    That is the ``start`` on the scale of the recording. What comes before the beginning of the run is left out. Raises
    ``ScenarioError`` for a sensor that the ``field`` does not have, and for one that cannot be set beside the start.
    """
    if unknown := [id for id in recording.readings if id not in field]:
        more = f" and {len(unknown) - 1} more" if len(unknown) > 1 else ""
        what = f"has reports of {quoted(unknown[0])}{more}, which the field does not have"
        raise ScenarioError(what, file=recording.file, expected=f"ids of the field, like {next(iter(field))}")
    shift_ns = origin_ns - round(recording.first_step_s(start) * _NS)
    own = {id: recording.readings.get(id, ()) for id in ids}
    return {id: tuple((t + shift_ns, values) for t, values in one if t + shift_ns >= 0) for id, one in own.items()}


def _start_of(targets: Collection[tuple[str, PathSection]], recordings: Sequence[Recording], step_s: float) -> Start:
    """When the first step is: as the first target's file says, if it has one; ``Start.of`` the recordings."""
    started = next((one.start(key) for key, one in targets), None)
    return Start.of(recordings, step_s) if started is None else started
