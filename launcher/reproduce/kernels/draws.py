"""Random numbers of many runs as one array: each run draws from its own generator, as it would alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np

from trackfield.draw import Key
from trackfield.filters.rng import generator
from trackfield.filters.types import Array

D = TypeVar("D", bound=NamedTuple)

Generators = Sequence[np.random.Generator]


def generators(seeds: Sequence[int], *purpose: Key) -> Generators:
    """A generator for each of these runs and this purpose: what one purpose draws does not change another's."""
    return [generator(seed, *purpose) for seed in seeds]


def normals(rngs: Generators, *shape: int) -> Array:
    """Independent draws from N(0, 1), (R, *shape)."""
    return np.stack([rng.standard_normal(shape) for rng in rngs])


def uniforms(rngs: Generators, *shape: int) -> Array:
    """Independent draws from [0, 1), (R, *shape)."""
    return np.stack([rng.random(shape) for rng in rngs])


def stacked(draws: Callable[[np.random.Generator], D], rngs: Generators) -> D:
    """The draws of a step, a named tuple of arrays, of all runs: the same tuple with arrays (R, ...)."""
    every: list[Any] = [draws(rng) for rng in rngs]
    return type(every[0])(*(np.stack(parts) for parts in zip(*every, strict=True)))  # type: ignore[no-any-return]
