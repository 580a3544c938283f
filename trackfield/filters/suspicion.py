"""The reliability of each sensor, from how often its readings were left out.

A sensor is sound or faulty, a Markov chain of two states. Sound sensors give clutter rarely, faulty ones mostly;
the gate's decision on a reading updates the probability by Bayes' rule (the forward algorithm of Rabiner 1989, eq. 20).
A sensor without history gives clutter with the gate's ``CLUTTER``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt
from immutables import Map

from trackfield.filters.gate import CLUTTER
from trackfield.filters.types import Array

_SOUND, _FAULTY = 0.03, 0.8
"""Probability that a reading of such a sensor is clutter."""
_FAILS, _RECOVERS = 0.001, 0.03
"""Probability per report that a sound sensor fails, and that a faulty one is sound again."""
_UNKNOWN: Final = (CLUTTER - _SOUND) / (_FAULTY - _SOUND)

Suspicion = Map[str, float]
"""The probability that a sensor is faulty, for sensors that have reported."""


def clutter(suspicion: Suspicion, sensors: Sequence[str]) -> Array:
    """The probability (K,) that the next reading of each of these is clutter."""
    faulty = np.array([suspicion.get(id, _UNKNOWN) for id in sensors])
    probability: Array = _SOUND + (_FAULTY - _SOUND) * faulty
    return probability


def learn(suspicion: Suspicion, sensors: Sequence[str], believed: npt.NDArray[np.intp]) -> Suspicion:
    """The suspicion after the readings of ``sensors``, of which those at ``believed`` were accepted.

    A step in which most were rejected says nothing about the sensors: then the track is wrong.
    """
    if 2 * len(believed) <= len(sensors):
        return suspicion
    kept = {sensors[i] for i in believed}
    for id in sensors:
        before = suspicion.get(id, _UNKNOWN)
        faulty = before * (1.0 - _FAULTY if id in kept else _FAULTY)
        sound = (1.0 - before) * (1.0 - _SOUND if id in kept else _SOUND)
        after = faulty / (faulty + sound)
        suspicion = suspicion.set(id, after * (1.0 - _RECOVERS) + (1.0 - after) * _FAILS)
    return suspicion
