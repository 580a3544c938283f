"""What the sensors of a field may sense: all targets, at an instant, or as what arrives now left them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot
from typing import Final

from trackfield.world.path import Path, State

_NS: Final = 1_000_000_000
_STEPS: Final = 50
_SETTLED_S: Final = 1e-9


@dataclass(frozen=True, slots=True)
class Scene:
    """The targets on these ``paths``."""

    paths: tuple[Path, ...]

    def at(self, t_ns: int) -> list[State]:
        """Where they are at this true time; those that are there."""
        t_s = t_ns / _NS
        return [state for path in self.paths if (state := path.at(t_s)) is not None]

    def retarded(self, t_ns: int, place: tuple[float, float], speed_m_s: float) -> list[State]:
        """Where they were when what arrives at ``place`` (m) now left them, at ``speed_m_s``.

        The time t' = t - |x(t') - place| / c, iterated from t: it converges as targets are slower than c.
        """
        t_s, (x, y) = t_ns / _NS, place
        found = []
        for path in self.paths:
            left_s, state = t_s, path.at(t_s) or path.at(min(t_s, path.end_s))
            for _ in range(_STEPS):
                if state is None:
                    break
                before, left_s = left_s, t_s - hypot(state[0] - x, state[1] - y) / speed_m_s
                state = path.at(left_s)
                if abs(left_s - before) < _SETTLED_S:
                    break
            if state is not None:
                found.append(state)
        return found


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
