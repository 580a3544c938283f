"""The sound files of a scenario: what targets sound like, and what real microphones heard, as samples for its nodes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path as FilePath
from typing import Final

import numpy as np

from trackfield.acoustics.signals import RATE
from trackfield.errors import ScenarioError
from trackfield.scenario.scenario import Scenario
from trackfield.scenario.sensors import SensorSection
from trackfield.world.heard import Sounds
from trackfield.world.windows import Windows

MOST_SOUND_S: Final = 60.0
"""The longest recording of what a target sounds like: 480 kB."""
MOST_HEARD_S: Final = 600.0
"""The longest recording of what a sensor heard: 4.8 MB, sent to each."""
_RECORDING: Final = "sensor.recording"
_LISTENS: Final = 'sensors of kind "cpa" with waveform = true'


def sounds_of(scenario: Scenario, sections: Mapping[str, SensorSection]) -> tuple[bytes | None, ...]:
    """What each target sounds like, in order, to sensors of these sections; empty if all are vehicles.

    Raises ``ScenarioError`` for a file that cannot be used, or that nobody listens to.
    """
    files = [(key, target.sound) for key, target in scenario.keyed_targets]
    named = [(key, file) for key, file in files if file]
    if not named:
        return ()
    if not any(section.sensing.hearing for section in sections.values()):
        key, file = named[0]
        raise ScenarioError("is of sound, and no sensor listens", file=file, key=f"{key}.sound", expected=_LISTENS)
    return tuple(None if file is None else _single(FilePath(file), f"{key}.sound") for key, file in files)


def _single(file: FilePath, key: str) -> bytes:
    channels = read_sound(file, MOST_SOUND_S, key)
    if len(channels) > 1:
        what = f"has {len(channels)} channels"
        raise ScenarioError(what, file=str(file), key=key, expected="one: what the target sounds like")
    if why := _useless(channels[0]):
        expected = "the sound of a vehicle that passes, or drives along"
        raise ScenarioError(why, file=str(file), key=key, expected=expected)
    return channels[0]


@lru_cache(maxsize=8)
def _useless(samples: bytes) -> str:
    """Why nothing can sound like this recording; empty if something can."""
    from trackfield.acoustics.recordings import recorded

    try:
        recorded(np.frombuffer(samples, "<i2"))
    except ValueError as error:
        return str(error)
    return ""


def recordings_heard(
    sections: Mapping[str, SensorSection], kinds: Mapping[str, frozenset[int]], ids: Sequence[str]
) -> dict[str, bytes]:
    """What real microphones recorded at sensors, by id: a channel for all of a kind, or one for each in their order.

    Raises ``ScenarioError`` for a file that cannot be used.
    """
    return dict(_heard(sections, kinds, ids))


def _heard(
    sections: Mapping[str, SensorSection], kinds: Mapping[str, frozenset[int]], ids: Sequence[str]
) -> Iterator[tuple[str, bytes]]:
    for name, section in sections.items():
        if section.listens_to is None or name not in kinds:
            continue
        if section.sensing.hearing is None:
            what = f"is of sound, and sensors of kind '{name}' do not listen"
            expected = f"a CSV or Parquet file, or {_LISTENS}"
            raise ScenarioError(what, file=section.listens_to, key=_RECORDING, expected=expected)
        file, own = FilePath(section.listens_to), [ids[i] for i in sorted(kinds[name])]
        channels = read_sound(file, MOST_HEARD_S, _RECORDING)
        if len(channels) not in (1, len(own)):
            expected = f"one, or one for each of its {len(own)} sensors"
            what = f"has {len(channels)} channels"
            raise ScenarioError(what, file=str(file), key=_RECORDING, expected=expected)
        yield from zip(own, channels * len(own) if len(channels) == 1 else channels, strict=True)


def heard_s(sections: Mapping[str, SensorSection]) -> float:
    """How long the longest of the recordings is that sensors listen to."""
    files = {section.listens_to for section in sections.values()} - {None}
    heard = (read_sound(FilePath(str(file)), MOST_HEARD_S, _RECORDING)[0] for file in files)
    return max(map(_seconds, heard), default=0.0)


def _seconds(samples: bytes) -> float:
    return len(samples) / 2.0 / RATE


def spell_of(samples: bytes, begins_ns: int) -> Windows:
    """From the first sample to the last."""
    return ((begins_ns, begins_ns + round(_seconds(samples) * 1e9)),)


def sounds_at(targets: tuple[bytes | None, ...], recording: bytes | None, begins_ns: int) -> Sounds:
    """What a sensor hears: its own recording if there is one, else the targets."""
    return Sounds(targets) if recording is None else Sounds((), recording, begins_ns)


def read_sound(file: FilePath, most_s: float, key: str = "") -> tuple[bytes, ...]:
    """The channels of a sound file: whole numbers of two bytes, little-endian, ``RATE`` a second.

    Raises ``ScenarioError``, with this ``key``, for one that cannot be read, or is too short or too long.
    """
    try:
        state = file.stat()
        version = state.st_mtime_ns, state.st_size
    except (OSError, ValueError):
        version = 0, 0  # its reader says what is wrong
    return _read(file, most_s, key, version)


@lru_cache(maxsize=8)
def _read(file: FilePath, most_s: float, key: str, version: tuple[int, int]) -> tuple[bytes, ...]:
    """``version`` tells two contents of a file apart."""
    from trackfield.acoustics.files import channels

    return tuple(channel.astype("<i2").tobytes() for channel in channels(file, most_s, key))
