"""What a sensor hears, sample by sample, and the passes that a detector finds in it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from trackfield.acoustics.signals import Sound
    from trackfield.filters.types import Array

Numbers = Sequence[float]
Pass = tuple[int, Numbers]
"""When (true ns) a sensor knew of a pass, and what it reports."""
Blocks = Callable[[int, int], "Iterator[tuple[int, Array]]"]
"""What is heard from one true time (ns) until another: pieces, each with the time of its first sample."""
Hear = Callable[[int, int], Iterator[tuple[int, Sequence[Pass]]]]
"""Listens from one true time (ns) until another: until when it has heard, and the passes that it knows of by then."""


class Audible(NamedTuple):
    """What there is to hear at a ``place``: targets on ``paths``, or what a real microphone recorded there.

    ``sounds`` are what each target emits, as samples, or None for a vehicle. A ``recording`` is played from
    ``begins_ns`` on, and nothing else is heard then. Samples are whole numbers of two bytes, little-endian, 4000
    a second. ``seed``, ``id`` and ``incarnation`` are the key of the noise.
    """

    place: tuple[float, float]
    paths: Sequence[Any]
    sounds: Sequence[bytes | None]
    seed: int
    id: str
    incarnation: int
    recording: bytes | None = None
    begins_ns: int = 0


def hearing(sensor: Any, audible: Audible) -> Hear:
    """What a ``cpa.Cpa`` hears."""
    blocks = blocks_of(sensor, audible)

    def hear(from_ns: int, until_ns: int) -> Iterator[tuple[int, Sequence[Pass]]]:
        from trackfield.acoustics.listener import Listener
        from trackfield.acoustics.signals import SAMPLE_NS

        listener, begun_ns = Listener(sensor.detector), None
        for at_ns, samples in blocks(from_ns, until_ns):
            begun_ns = at_ns if begun_ns is None else begun_ns
            told = [(begun_ns + round(one.known_s * 1e9), _numbers(sensor, one)) for one in listener.feed(samples)]
            yield at_ns + len(samples) * SAMPLE_NS, told

    return hear


def blocks_of(sensor: Any, audible: Audible) -> Blocks:
    """The samples that a ``cpa.Cpa`` hears."""
    return _synthesised(sensor, audible) if audible.recording is None else _played(audible)


def _numbers(sensor: Any, detection: Any) -> Numbers:
    """A detection as a reading at the instant at which it is known."""
    sds = (detection.time_sd_s, detection.strength_sd_db) if sensor.variances else ()
    return (detection.peak_s - detection.known_s, detection.strength_db, detection.width_s, *sds)


def _synthesised(sensor: Any, audible: Audible) -> Blocks:
    from trackfield.acoustics.microphone import Microphone

    sounds = [_sound(audible.seed, number, samples) for number, samples in enumerate(audible.sounds)]
    return Microphone(
        audible.paths,
        audible.place,
        sounds,
        seed=audible.seed,
        id=audible.id,
        incarnation=audible.incarnation,
        snr_db=sensor.snr_db,
        snr_at_m=sensor.snr_at_m,
        sound_m_s=sensor.sound_m_s,
    ).blocks


@lru_cache(maxsize=64)
def _sound(seed: int, number: int, samples: bytes | None) -> Sound:
    """What the target of this number emits: the same object for all who hear it in this process."""
    from trackfield.acoustics.sources import engine

    if samples is None:
        return engine(seed, str(number))
    import numpy as np

    from trackfield.acoustics.recordings import recorded

    return recorded(np.frombuffer(samples, "<i2"))


def _played(audible: Audible) -> Blocks:
    import numpy as np

    from trackfield.acoustics.recordings import Playback

    return Playback(np.frombuffer(audible.recording or b"", "<i2"), audible.begins_ns).blocks
