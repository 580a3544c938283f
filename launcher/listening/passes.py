"""The passes of a recording."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from trackfield.acoustics.files import blocks
from trackfield.acoustics.fitting import BIN_S, Curve
from trackfield.acoustics.listener import Detection, Heard, Listener
from trackfield.acoustics.signals import RATE
from trackfield.filters.types import Array

_BIN: Final = round(BIN_S * RATE)
"""Samples of 20 ms."""
_LOOK: Final = RATE // 10


class Pass(NamedTuple):
    """A pass, and the curve that was fitted to it."""

    detection: Detection
    curve: Curve


class Listened(NamedTuple):
    """A recording of so many ``seconds``, and its passes in order.

    ``energies`` (n,) are mean squares above 100 Hz over 20 ms around ``t_s`` (n,). ``low`` and ``high`` (k,) are the
    lowest and highest samples, all frequencies included, of 20 ms around ``outline_s`` (k,): the filter puts the bins
    of the two at different times.
    """

    seconds: float
    passes: tuple[Pass, ...]
    t_s: Array
    energies: Array
    outline_s: Array
    low: Array
    high: Array


def listen(file: Path, detector: str, key: str) -> Listened:
    """Listen to a file, piece by piece. Raises ``ScenarioError``, with this ``key``, if it cannot be heard."""
    listener, found, told, outlines = Listener(detector), list[Pass](), list[Heard](), list[Array]()
    waiting, length = np.zeros(0), 0
    for piece in _looks(blocks(file, key)):
        length += len(piece)
        found += [Pass(one, listener.passes[-1]) for one in listener.feed(piece)]
        told.append(_since(listener.heard, told))
        waiting = np.concatenate((waiting, piece))
        whole = waiting[: len(waiting) // _BIN * _BIN].reshape(-1, _BIN)
        outlines.append(np.stack((whole.min(axis=1), whole.max(axis=1))))
        waiting = waiting[whole.size :]
    t_s, energies = (np.concatenate([getattr(some, name) for some in told]) for name in ("t_s", "energies"))
    low, high = np.concatenate(outlines, axis=1)
    outline_s = (np.arange(len(low)) + 0.5) * _BIN / RATE
    return Listened(length / RATE, tuple(found), t_s, energies, outline_s, low, high)


def _looks(pieces: Iterator[Array]) -> Iterator[Array]:
    """The same in pieces of a tenth of a second at most: a listener tells one pass at most of each."""
    for piece in pieces:
        yield from (piece[first : first + _LOOK] for first in range(0, len(piece), _LOOK))


def _since(heard: Heard, before: list[Heard]) -> Heard:
    """What is new in ``heard``: later than all that was new ``before``."""
    last_s = next((one.t_s[-1] for one in reversed(before) if len(one.t_s)), -np.inf)
    first = int(np.searchsorted(heard.t_s, last_s + BIN_S / 2.0))
    return Heard(*(part[first:] for part in heard))
