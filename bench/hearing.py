"""How many times as fast as real time a core makes and hears sound, as a table in Markdown.

    OPENBLAS_NUM_THREADS=1 python -m bench.hearing [--rounds 5] [--seconds 60]

Processor time is measured, so other load on the machine matters little; the ratios are medians over the rounds.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from typing import Final

import numpy as np

from bench.scale import machine
from trackfield.acoustics.listener import Listener
from trackfield.acoustics.microphone import Microphone
from trackfield.acoustics.signals import RATE
from trackfield.acoustics.sources import engine
from trackfield.filters.types import Array
from trackfield.world.path import Path

PASS_EVERY_S: Final = 10.0
_FAR_M, _AWAY_M = 65.0, 10.0


def path(seconds: float) -> Path:
    """Back and forth past the origin at 13 m/s, 10 m away, once in ten seconds."""
    knots = []
    for turn in range(round(seconds / PASS_EVERY_S) + 1):
        east = _FAR_M if turn % 2 else -_FAR_M
        for speed in (east, -east):  # arrives, and leaves the other way
            knots.append((turn * PASS_EVERY_S, east, _AWAY_M, speed / 5.0, 0.0))
    return Path.of(knots)


def heard(seconds: float) -> Array:
    """(n,) what a microphone at the origin hears."""
    microphone = Microphone([path(seconds)], (0.0, 0.0), [engine(1, "a")], seed=1, id="n")
    return np.concatenate([piece for _, piece in microphone.blocks(0, round(seconds * 1e9))])


def listened(samples: Array) -> int:
    """How many passes are found, fed in quarters of a second."""
    listener = Listener()
    return sum(len(listener.feed(samples[first : first + RATE // 4])) for first in range(0, len(samples), RATE // 4))


def ratio(run: Callable[[], object], seconds: float, rounds: int) -> float:
    """Seconds of sound by seconds of processor time."""
    taken = []
    for _ in range(rounds):
        begun = time.process_time()
        run()
        taken.append(time.process_time() - begun)
    return seconds / statistics.median(taken)


def table(seconds: float, rounds: int) -> list[str]:
    """A row for each."""
    busy = heard(seconds)
    quiet = np.random.default_rng(1).standard_normal(len(busy)) * 0.01
    rows = (
        ("a microphone's waveform, one vehicle", lambda: heard(seconds)),
        (f"listening, {listened(busy)} passes in {seconds:g} s", lambda: listened(busy)),
        ("listening, ambient noise", lambda: listened(quiet)),
    )
    lines = ["| per core | times real time |", "| --- | ---: |"]
    return lines + [f"| {name} | {ratio(run, seconds, rounds):,.0f} |" for name, run in rows]


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=60.0)
    options = parser.parse_args()
    print(machine())
    print("\n".join(table(options.seconds, options.rounds)))


if __name__ == "__main__":
    main()
