"""A target's path for many instants at once, and when what is heard there left it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from trackfield.filters.types import Array

if TYPE_CHECKING:
    from trackfield.world.path import Path

_ROUNDS: Final = 60
_SETTLED_S: Final = 1e-9


class Heard(NamedTuple):
    """What arrives at a place at n instants.

    ``left_s`` (n,) is when it left the target, ``distance_m`` (n,) how far away, ``closing_m_s`` (n,) the speed at
    which the distance shrank then. ``there`` (n,) is False where nothing arrives: before the first that left the
    target, after the last, and of stretches that the path lacks.
    """

    left_s: Array
    distance_m: Array
    closing_m_s: Array
    there: np.ndarray[tuple[int], np.dtype[np.bool_]]


class Course:
    """A ``Path`` as arrays."""

    def __init__(self, path: Path) -> None:
        self._t = np.array(path.t)
        at = np.array([path.x, path.y]).T
        speed = np.array([path.vx, path.vy]).T
        span = np.diff(self._t)[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):  # two knots at one instant: never looked up
            mean = np.diff(at, axis=0) / span
            square = (3.0 * mean - 2.0 * speed[:-1] - speed[1:]) / span
            cube = (speed[:-1] + speed[1:] - 2.0 * mean) / span**2
        self._pieces = np.stack((at[:-1], speed[:-1], square, cube), axis=1)
        """(stretches, 4, 2) the coefficients of each stretch's cubic."""
        self._knots = at
        self._missing = np.zeros(max(len(self._t) - 1, 1), bool)
        self._missing[list(path.missing)] = True

    def heard(self, t_s: Array, place: tuple[float, float], sound_m_s: float) -> Heard:
        """What arrives at ``place`` (m) at the times ``t_s`` (n,), at ``sound_m_s``, which no target reaches.

        It left at t' with t' + d(t')/c = t, where d is the distance. The left side grows with t', as targets are slower
        than c: the stretch is found by its ends, and within it t' by Newton's method, or halving where that leaves
        the interval.
        """
        arrivals = self._t + np.hypot(*(self._knots - place).T) / sound_m_s
        arrivals = np.maximum.accumulate(arrivals)
        there = (t_s >= arrivals[0]) & (t_s <= arrivals[-1])
        if len(self._t) < 2 or not there.any():
            nothing = np.zeros_like(t_s)
            return Heard(nothing, nothing + 1.0, nothing, np.zeros(len(t_s), bool))
        stretch = np.clip(np.searchsorted(arrivals, t_s, side="right") - 1, 0, len(self._t) - 2)
        left_s, away, closing = self._solved(np.clip(t_s, arrivals[0], arrivals[-1]), stretch, place, sound_m_s)
        return Heard(left_s, away, closing, there & ~self._missing[stretch])

    def _solved(
        self, t_s: Array, stretch: np.ndarray[tuple[int], np.dtype[np.intp]], place: tuple[float, float], c: float
    ) -> tuple[Array, Array, Array]:
        """When it left, the distance then, and how fast that shrank."""
        begin, low, high = self._t[stretch], self._t[stretch], self._t[stretch + 1]
        a, b, square, cube = np.moveaxis(self._pieces[stretch], 1, 0)
        left_s = low
        for _ in range(_ROUNDS):
            s = (left_s - begin)[:, None]
            off = a + s * (b + s * (square + s * cube)) - place
            speed = b + s * (2.0 * square + 3.0 * s * cube)
            away = np.hypot(off[:, 0], off[:, 1])
            closing = -(off * speed).sum(axis=1) / np.maximum(away, 1e-9)
            over = left_s + away / c - t_s
            if (np.abs(over) < _SETTLED_S).all():
                break
            low, high = np.where(over < 0.0, left_s, low), np.where(over < 0.0, high, left_s)
            newer = left_s - over / (1.0 - closing / c)
            left_s = np.where((newer >= low) & (newer <= high), newer, (low + high) / 2.0)
        return left_s, away, closing
