"""Modes of motion that differ in how fast the target turns, as a Markov chain; positive rates turn left.

Yu et al. (2009), eqs. 5 to 7 and 10: straight ahead, a turn, and one to the other side. (6) and (7) as printed are no
rotations; here (6) is in complex numbers, position z and velocity v: z' = z + a v, v' = f v with f = e^{iwT} and
a = (f - 1) / (iw), and (7) is the same with -w.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from trackfield.filters.types import Array

Complex = npt.NDArray[np.complex128]
Indices = npt.NDArray[np.intp]


class Turns(NamedTuple):
    """M modes: the chances ``switching`` (M, M) of going in a step from the mode of a row to that of a column.

    ``rates`` (M,) rad/s are those of the modes. With a ``most`` above 0 (rad/s) only their signs are known: a target
    that enters a turn gets any rate up to it.
    """

    switching: Array
    rates: Array
    most: float = 0.0


STRAIGHT = Turns(np.ones((1, 1)), np.zeros(1))
"""A target that never turns."""


@lru_cache(maxsize=16)
def left_and_right(left: float, right: float, enter: float, leave: float, swap: float, most: float = 0.0) -> Turns:
    """Straight ahead, left at ``left`` rad/s, right at ``right`` rad/s.

    ``enter`` is the chance in a step that a target which goes straight ahead begins either turn, ``leave`` that a turn
    ends, and ``swap`` that it becomes one to the other side.
    """
    stay = 1.0 - leave - swap
    switching = np.array([[1.0 - 2.0 * enter, enter, enter], [leave, stay, swap], [leave, swap, stay]])
    return Turns(switching, np.array([0.0, left, -right]), most)


def turned(rate: Array, dt: float) -> tuple[Complex, Complex]:
    """(a, f) of the motion over ``dt`` seconds at these rates (...,) rad/s; (dt, 1) straight ahead."""
    angle = (0.5 * dt) * rate
    half = np.exp(1j * angle)
    chord = np.divide(half.imag, angle, out=np.ones_like(angle), where=angle != 0.0)
    return (dt * chord) * half, half * half


def evenly_spread(n: int, rng: np.random.Generator) -> Array:
    """Uniform numbers (n,), one of each nth of [0, 1): a stratified draw.

    In an order of its own each time: neighbours after resampling have one ancestor, and in one and the same order a
    particle would get the same mode in each step.
    """
    spread: Array = (rng.permutation(n) + rng.random(n)) / n
    return spread


def drawn(probability: Array, uniforms: Array) -> Indices:
    """A mode for each of ``uniforms`` (..., N), of probabilities (..., M) or one row for each (..., N, M)."""
    edges = probability.cumsum(axis=-1)[..., :-1]
    if edges.ndim == uniforms.ndim:
        edges = edges[..., None, :]
    return np.asarray((uniforms[..., None] >= edges).sum(axis=-1))


def followed(mode: Indices, uniforms: Array, turns: Turns) -> Indices:
    """The mode after each ``mode`` (...) by the Markov chain."""
    after = np.zeros_like(mode)
    for edge in turns.switching.cumsum(axis=-1).T[:-1]:
        after += uniforms >= edge.take(mode)
    return after


def rates_of(mode: Indices, before: Indices, rate: Array, uniforms: Array, turns: Turns) -> Array:
    """The rates (...) rad/s of modes, which came from the modes ``before`` with their ``rate``."""
    if not turns.most:
        return turns.rates.take(mode)
    return np.where(mode == before, rate, (np.sign(turns.rates) * turns.most).take(mode) * uniforms)


def shares(weights: Array, mode: Indices, m: int) -> Array:
    """The weight (..., M) of each of ``m`` modes, of weights (..., N)."""
    runs = mode.shape[:-1]
    several = mode + m * np.arange(np.prod(runs, dtype=int)).reshape(*runs, 1) if runs else mode
    counted = np.bincount(several.ravel(), weights.ravel(), several[..., 0].size * m)
    return np.asarray(counted, float).reshape(*runs, m)
