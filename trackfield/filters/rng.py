"""Random numbers for filters, keyed by what they are for."""

from __future__ import annotations

from numpy.random import Generator, Philox

from trackfield.draw import Key, bits


def generator(seed: int, *key: Key) -> Generator:
    """A generator of its own for this key: equal keys give equal draws in every process and order."""
    return Generator(Philox(key=bits(seed, *key)))
