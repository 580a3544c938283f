"""The passes of a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from trackfield.acoustics.files import blocks
from trackfield.acoustics.fitting import Curve
from trackfield.acoustics.listener import Detection, Heard, Listener
from trackfield.acoustics.signals import RATE
from trackfield.filters.types import Array

_BIN: Final = RATE // 50
"""Samples of 20 ms."""


class Pass(NamedTuple):
    """A pass, and the curve that was fitted to it."""

    detection: Detection
    curve: Curve


class Listened(NamedTuple):
    """A recording of so many ``seconds``, and its passes in order.

    ``t_s`` (n,) are the middles of its 20 ms bins, ``energies`` (n,) their mean squares above 100 Hz, and ``low`` and
    ``high`` (n,) the lowest and highest samples, all frequencies included.
    """

    seconds: float
    passes: tuple[Pass, ...]
    t_s: Array
    energies: Array
    low: Array
    high: Array


def listen(file: Path, detector: str, key: str) -> Listened:
    """Listen to a file, piece by piece. Raises ``ScenarioError``, with this ``key``, if it cannot be heard."""
    listener, found, told, outlines = Listener(detector), list[Pass](), list[Heard](), list[Array]()
    waiting, length = np.zeros(0), 0
    for piece in blocks(file, key):
        length += len(piece)
        found += [Pass(one, listener.passes[-1]) for one in listener.feed(piece)]
        told.append(_since(listener.heard, told[-1] if told else None))
        waiting = np.concatenate((waiting, piece))
        whole = waiting[: len(waiting) // _BIN * _BIN].reshape(-1, _BIN)
        outlines.append(np.stack((whole.min(axis=1), whole.max(axis=1))))
        waiting = waiting[whole.size :]
    t_s, energies = (np.concatenate([getattr(some, name) for some in told]) for name in ("t_s", "energies"))
    low, high = np.concatenate(outlines, axis=1)
    bins = min(len(t_s), len(low))
    return Listened(length / RATE, tuple(found), t_s[:bins], energies[:bins], low[:bins], high[:bins])


def _since(heard: Heard, before: Heard | None) -> Heard:
    """What is new in ``heard``: later than all that was new ``before``."""
    first = 0 if before is None or not len(before.t_s) else int(np.searchsorted(heard.t_s, before.t_s[-1] + 0.01))
    return Heard(*(part[first:] for part in heard))
