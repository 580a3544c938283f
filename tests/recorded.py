"""Recordings in k7 form of fields whose links are known: what nodes would have measured there."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from datetime import datetime, timedelta
from typing import Any, Final, NamedTuple

import numpy as np

from trackfield.link import make_link
from trackfield.link.bursty import Bursty
from trackfield.link.dwells import Dwells
from trackfield.link.k7 import COLUMNS, SYNC_BYTES
from trackfield.link.lognormal_prr import LognormalPrr
from trackfield.link.places import Point

BEGIN: Final = datetime(2018, 1, 11, 16, 30)
S: Final = 1_000_000_000


class Schedule(NamedTuple):
    """When who sends: each node a burst of ``frames`` on a channel, one after another every ``slot_s``, then the next
    channel, in ``rounds`` of all ``channels``. A frame has ``bytes`` without preamble and length, and there is one
    every ``frame_s``. The defaults are those of the recording at Grenoble.
    """

    rounds: int = 19
    channels: int = 16
    frames: int = 100
    frame_s: float = 0.1
    slot_s: float = 11.32
    bytes: int = 100


Good = Callable[[str, str, int], int]
"""How many frames of a burst, from src to dst and begun at an instant (ns), are sent while the link is good."""


def recorded(
    section: Mapping[str, Any], places: Mapping[str, Point], seed: int, schedule: Schedule, *, apart: bool = False
) -> str:
    """The text of a recording among these places with this ``[link]``, a ``lognormal_prr`` with or without bursts.

    ``apart``: windows are so far apart that bursts in one have nothing to do with those in another. Then they are drawn
    for each window by itself, without following every link from one to the next.
    """
    link = make_link(section, seed, places)
    radio, good = link, _always(schedule)
    if isinstance(link, Bursty):
        radio = link.link
        good = _drawn(link, schedule, np.random.default_rng([seed, 8])) if apart else _followed(link._dwells, schedule)
    assert isinstance(radio, LognormalPrr)
    head = {"tx_length": schedule.bytes, "interframe_duration": schedule.frame_s * 1000, "node_count": len(places)}
    return "\n".join([json.dumps(head), COLUMNS, *_lines(radio, good, places, seed, schedule)]) + "\n"


def _lines(
    radio: LognormalPrr, good: Good, places: Mapping[str, Point], seed: int, schedule: Schedule
) -> Iterator[str]:
    rng = np.random.default_rng([seed, 7])
    on_air = schedule.bytes + SYNC_BYTES
    links = {src: _heard(radio, src, places, on_air) for src in places}
    for number in range(schedule.rounds * schedule.channels):
        for turn, src in enumerate(places):
            at_s = round((number * len(places) + turn) * schedule.slot_s)
            stamp = (BEGIN + timedelta(seconds=at_s)).isoformat()
            for dst, prr, rssi in links[src]:
                if got := int(rng.binomial(good(src, dst, at_s * S), prr)):
                    share = got / schedule.frames
                    yield f"{stamp},{src},{dst},{11 + number % schedule.channels},{rssi:.2f},{share},{schedule.frames}"


def _heard(radio: LognormalPrr, src: str, places: Mapping[str, Point], on_air: int) -> list[tuple[str, float, float]]:
    """Receivers that may get a frame: the share of them, and the RSSI in dBm."""
    others = [dst for dst in places if dst != src]
    found = [(dst, radio.prr(src, dst, on_air), radio.snr_db(src, dst) + radio.noise_dbm) for dst in others]
    return [one for one in found if one[1] > 1e-9]


def _always(schedule: Schedule) -> Good:
    return lambda src, dst, begin_ns: schedule.frames


def _followed(dwells: Dwells, schedule: Schedule) -> Good:
    """By the link itself."""
    every = round(schedule.frame_s * S)

    def good(src: str, dst: str, begin_ns: int) -> int:
        at = count = 0
        while at < schedule.frames:
            bad = dwells.bad(src, dst, begin_ns + at * every)
            _, _, end, _ = dwells._last[*dwells.purpose, src, dst]  # as long as it stays so
            until = min(-(-(end - begin_ns) // every), schedule.frames)
            count += 0 if bad else until - at
            at = until
        return count

    return good


def _drawn(link: Bursty, schedule: Schedule, rng: np.random.Generator, batch: int = 20_000) -> Good:
    """The same process in its stationary state: of the state, exp(-t / tau) is kept from frame to frame."""
    p, kept = link.burst_loss, np.exp(-schedule.frame_s / (link.burst_s * (1 - link.burst_loss)))

    def counts() -> Iterator[int]:
        while True:
            bad = rng.random(batch) < p
            count = np.zeros(batch, int)
            for _ in range(schedule.frames):
                count += ~bad
                bad = np.where(rng.random(batch) < kept, bad, rng.random(batch) < p)
            yield from count.tolist()

    each = counts()
    return lambda src, dst, begin_ns: next(each)
