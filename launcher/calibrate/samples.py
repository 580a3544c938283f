"""A recording of delivery ratios as arrays: what each receiver got of each burst that it could have heard."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from trackfield.link.k7 import Recording

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

DEAF_BURSTS: Final = 10
"""A receiver that hears nobody for longer than this many bursts of each sender is taken to be off."""


@dataclass(frozen=True)
class Samples:
    """Windows (W,), one for each burst and each other node that was on, in the order of sender, receiver and time.

    ``src`` and ``dst`` are indices of ``nodes``; ``at_s`` is the burst's begin, ``channel`` its channel, ``pdr`` the
    share that was received (0: nothing), ``rssi_dbm`` the mean RSSI of that (NaN: nothing). ``frames`` were sent in a
    burst, ``frame_bytes`` long on the air, one every ``frame_s``.
    """

    nodes: tuple[str, ...]
    src: Ints
    dst: Ints
    at_s: Floats
    channel: Ints
    pdr: Floats
    rssi_dbm: Floats
    frames: int
    frame_bytes: int
    frame_s: float

    @cached_property
    def links(self) -> Links:
        """The same by link."""
        n = len(self.nodes)
        number = self.src * n + self.dst
        found, inverse = np.unique(number, return_inverse=True)
        received = np.where(np.isnan(self.rssi_dbm), 0.0, self.pdr)
        windows, got = np.bincount(inverse), np.bincount(inverse, received)
        level = np.bincount(inverse, received * np.nan_to_num(self.rssi_dbm))
        with np.errstate(invalid="ignore"):
            return Links(found // n, found % n, windows, np.bincount(inverse, self.pdr) / windows, level / got, inverse)


@dataclass(frozen=True)
class Links:
    """Directed links (L,): their ends as indices, the number of windows, the share received over all of them, and the
    mean RSSI of what was received (NaN: nothing). ``of_window`` (W,) is the link of each window.
    """

    src: Ints
    dst: Ints
    windows: Ints
    pdr: Floats
    rssi_dbm: Floats
    of_window: Ints

    @property
    def heard(self) -> Bools:
        """(L,) whether anything was received."""
        return np.isfinite(self.rssi_dbm)


def samples_of(recording: Recording) -> Samples:
    """The windows of a recording. Raises ``ValueError`` if it has less than two nodes that are ever on."""
    number = {node: i for i, node in enumerate(recording.nodes)}
    gone = _deaf(recording)
    rows = []
    for src, bursts in recording.bursts.items():
        for dst in recording.nodes:
            for burst in bursts if dst != src else ():
                if any(begin < burst.at_s < end for begin, end in gone[dst]):
                    continue
                pdr, rssi = burst.heard.get(dst, (0.0, np.nan))
                rows.append((number[src], number[dst], burst.at_s, burst.channel, pdr, rssi))
    if not rows:
        raise ValueError("no node hears another")
    table = np.array(rows, np.float64)
    table = table[np.lexsort((table[:, 2], table[:, 1], table[:, 0]))]
    src_, dst_, at_s, channel, pdr_, rssi_ = table.T
    frames = np.array([burst.frames for bursts in recording.bursts.values() for burst in bursts])
    return Samples(
        recording.nodes,
        src_.astype(np.int64),
        dst_.astype(np.int64),
        at_s,
        channel.astype(np.int64),
        pdr_,
        rssi_,
        int(np.median(frames)),
        recording.frame_bytes,
        recording.frame_s,
    )


def _deaf(recording: Recording) -> dict[str, list[tuple[float, float]]]:
    """By receiver, the times (from s, until s) in which it is taken to be off."""
    gaps = [np.diff([burst.at_s for burst in bursts]) for bursts in recording.bursts.values()]
    every = np.concatenate(gaps) if gaps else np.empty(0)
    most_s = DEAF_BURSTS * float(np.median(every)) if len(every) else np.inf
    heard: dict[str, list[float]] = {node: [] for node in recording.nodes}
    for bursts in recording.bursts.values():
        for burst in bursts:
            for dst in burst.heard:
                heard[dst].append(burst.at_s)
    found = {}
    for node, times in heard.items():
        ends = np.array([-most_s / 2, *sorted(times), recording.end_s + most_s / 2])
        wide = np.flatnonzero(np.diff(ends) > most_s)
        found[node] = [(float(ends[i]), float(ends[i + 1])) for i in wide]
    return found
