"""What the sensors of a field may sense: all targets, at an instant, or as what arrives now left them."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot
from typing import Final

from trackfield.world.path import Path, State

_NS: Final = 1_000_000_000
_ROUNDS: Final = 60
_SETTLED_S: Final = 1e-9
_HEARD_S: Final = 1e-6


@dataclass(frozen=True, slots=True)
class Scene:
    """The targets on these ``paths``."""

    paths: tuple[Path, ...]

    def at(self, t_ns: int) -> list[State]:
        """Where they are at this true time; those that are there."""
        t_s = t_ns / _NS
        return [state for path in self.paths if (state := path.at(t_s)) is not None]

    def retarded(self, t_ns: int, place: tuple[float, float], speed_m_s: float) -> list[State]:
        """Where they were when what arrives at ``place`` (m) now left them, at ``speed_m_s``, which they do not reach.

        A target is missing until what left it first has arrived, and once what left it last has.
        """
        t_s, (x, y) = t_ns / _NS, place
        found = []
        for path in self.paths:
            left_s = left_at(path, t_s, place, speed_m_s)
            state = path.at(left_s)
            if state is not None and abs(left_s + hypot(state[0] - x, state[1] - y) / speed_m_s - t_s) < _HEARD_S:
                found.append(state)
        return found

    def alone(self) -> list[Scene]:
        """The scene of each target, as if there were no other."""
        return [Scene((path,)) for path in self.paths]


def left_at(path: Path, t_s: float, place: tuple[float, float], speed_m_s: float) -> float:
    """When what arrives at ``place`` at ``t_s`` left the target; the start or the end of the path if none of it does.

    The time t' with t' + d(t')/c = t, where d is the distance and c the speed. The left side grows with t' as targets
    are slower than c: so it lies between two knots, and there Newton's method finds it, or halving where that leaves
    the interval.
    """
    x, y = place
    later = bisect_right(
        range(len(path.t)), t_s, key=lambda i: path.t[i] + hypot(path.x[i] - x, path.y[i] - y) / speed_m_s
    )
    if later in (0, len(path.t)):
        return path.end_s if later else path.start_s
    low, high = path.t[later - 1], path.t[later]
    left_s = low
    for _ in range(_ROUNDS):
        state = path.at(left_s)
        if state is None:  # in a stretch that was cut away
            break
        east, north = state[0] - x, state[1] - y
        away = hypot(east, north)
        over = left_s + away / speed_m_s - t_s
        if abs(over) < _SETTLED_S:
            break
        low, high = (left_s, high) if over < 0.0 else (low, left_s)
        closing = (east * state[2] + north * state[3]) / (away * speed_m_s) if away else 0.0
        left_s -= over / (1.0 + closing) if closing > -1.0 else 0.0
        if not low < left_s < high:
            left_s = (low + high) / 2.0
    return left_s


@dataclass(frozen=True, slots=True)
class Still:
    """A single target that rests in one place."""

    state: State

    def at(self, t_ns: int) -> Sequence[State]:
        """It, at any time."""
        return (self.state,)

    def retarded(self, t_ns: int, place: tuple[float, float], speed_m_s: float) -> Sequence[State]:
        """The same."""
        return (self.state,)

    def alone(self) -> Sequence[Still]:
        """It."""
        return (self,)
