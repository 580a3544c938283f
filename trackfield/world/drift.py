"""Targets of nearly constant velocity, with random accelerations and known turns.

Özfidan et al. (2018), eqs. 1 to 6: the acceleration is white noise. Zhou et al. (2011), eq. 10: it is held for a step,
x_k = Phi x_{k-1} + G w with G = [T^2/2, T] on each axis. Yu et al. (2009), eqs. 5 to 7: the target turns at times.
"""

from __future__ import annotations

from cmath import exp
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, cos, radians, sin, sqrt
from typing import Final, NamedTuple

from trackfield.draw import Key, normal, uniform
from trackfield.models.motion import white_acceleration
from trackfield.world.path import Knot, Path, State

TRIES: Final = 5000
"""Paths that are drawn at most, to find one that stays."""
MOST_DRAWN: Final = 500_000
"""Steps that are drawn at most for that, of all paths together: some seconds."""
ARC_DEG: Final = 45.0
"""The most that a target turns between two knots: the cubic is then within 0.1 % of the radius of the arc."""

Turn = tuple[float, float, float]
"""From when (s), until when, and at which rate (deg/s, positive to the left)."""


class _Part(NamedTuple):
    """A part of a ``step`` in which the rate of turning (rad/s) is one: until ``end_s``, for ``dt`` seconds."""

    step: int
    number: int
    end_s: float
    dt: float
    rate: float


@dataclass(frozen=True, slots=True)
class Drift:
    """How such a target moves, and the square that it does not leave.

    ``q`` is the density of the acceleration's noise on each axis (m^2/s^3). If it is ``held``, it is new at each step
    and then constant, with the variance q / step_s, so that the velocity of a step is as uncertain as without. The
    target starts at ``start`` (x, y in m) with ``speed_m_s`` in the direction ``heading_deg``, clockwise from north,
    None for any, drawn; ``start_sd`` are the sds of what is added to that, of x, y (m), vx, vy (m/s). The square has
    ``start`` in its middle and sides of twice ``half_width_m``. In one of the ``turns``, which are in order and do not
    overlap, the velocity turns at its rate, besides the noise.
    """

    q: float
    speed_m_s: float
    heading_deg: float | None
    half_width_m: float
    start: tuple[float, float] = (0.0, 0.0)
    held: bool = False
    start_sd: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    turns: tuple[Turn, ...] = ()

    def path(self, seed: int, steps: int, step_s: float, id: str = "target") -> Path:
        """A path of so many steps that is in the square at each of them; another seed or ``id`` gives another path.

        The states at steps are exact draws of the motion. Between two of them the path is the cubic through both,
        which is the mean of all motions that have these two. One that leaves the square is drawn again as a whole, its
        heading too, so a longer path may be another one. Raises ``ValueError`` if none is found that stays.
        """
        parts = list(self._parts(steps, step_s))
        drawn = 0
        for attempt in range(TRIES):
            knots = self._drawn(seed, parts, step_s, (id, 0, "drift", attempt))
            if len(knots) > len(parts):
                return Path.of(knots)
            drawn += len(knots)
            if drawn > MOST_DRAWN:
                break
        raise ValueError(f"{attempt + 1} paths of {steps} steps were drawn, and none stays within it")

    def _parts(self, steps: int, step_s: float) -> Iterator[_Part]:
        """The steps, divided where turns begin and end, and where one goes on for more than ``ARC_DEG``."""
        turns = [(_whole_ns(since), _whole_ns(until), rate) for since, until, rate in self.turns]
        for k in range(steps):
            begin_s, end_s, number = _whole_ns(k * step_s), _whole_ns((k + 1) * step_s), 0
            corners = {t for turn in turns for t in turn[:2] if begin_s < t < end_s}
            for a, b in pairwise([begin_s, *sorted(corners), end_s]):
                rate = next((rate for since, until, rate in turns if since <= a and b <= until), 0.0)
                pieces = max(ceil(round(abs(rate) * (b - a) / ARC_DEG, 6)), 1)
                dt = (b - a if corners else step_s) / pieces
                for piece in range(pieces):
                    yield _Part(k, number, b if piece == pieces - 1 else a + (piece + 1) * dt, dt, radians(rate))
                    number += 1

    def _drawn(self, seed: int, parts: Sequence[_Part], step_s: float, key: tuple[Key, ...]) -> list[Knot]:
        """The knots of a path at its start and at the end of each part, as far as it is in the square."""
        half, (x0, y0) = self.half_width_m, self.start
        x, y, vx, vy = self._begun(seed, key)
        knots: list[Knot] = []
        if abs(x - x0) <= half and abs(y - y0) <= half:
            knots.append((0.0, x, y, vx, vy))
        for part in parts if knots else ():
            x, y, vx, vy = _moved((x, y, vx, vy), part.dt, part.rate)
            to_place, to_speed, rest = self._root(part.dt, step_s)
            which = (part.step, part.number) if part.number and not self.held else (part.step,)
            a, c = (normal(seed, *key, what, *which) for what in ("vx", "vy"))
            x, vx, y, vy = x + to_place * a, vx + to_speed * a, y + to_place * c, vy + to_speed * c
            if not self.held:
                x, y = (at + rest * normal(seed, *key, what, *which) for at, what in ((x, "x"), (y, "y")))
            if abs(x - x0) > half or abs(y - y0) > half:
                break
            knots.append((part.end_s, x, y, vx, vy))
        return knots

    def _begun(self, seed: int, key: tuple[Key, ...]) -> State:
        """Where a path begins, and how fast (x, y, vx, vy)."""
        heading = 360.0 * uniform(seed, *key, "heading") if self.heading_deg is None else self.heading_deg
        x, y = self.start
        vx, vy = self.speed_m_s * sin(radians(heading)), self.speed_m_s * cos(radians(heading))
        off = (sd * normal(seed, *key, "start", i) if sd else 0.0 for i, sd in enumerate(self.start_sd))
        return x + next(off), y + next(off), vx + next(off), vy + next(off)

    def _root(self, dt: float, step_s: float) -> tuple[float, float, float]:
        """What a draw adds to place and velocity of an axis in ``dt`` seconds, and what another adds to its place."""
        if self.held:
            sd = sqrt(self.q / step_s)
            return sd * dt**2 / 2.0, sd * dt, 0.0
        (place, both), (_, speed) = white_acceleration(dt, self.q)
        sd = sqrt(speed)
        shared = both / sd if sd else 0.0
        return shared, sd, sqrt(max(place - shared**2, 0.0))


def _moved(state: State, dt: float, rate: float) -> State:
    """The state after ``dt`` seconds at a ``rate`` of turning in rad/s, positive to the left.

    Yu et al. (2009), eq. 6 as a rotation: with z = x + iy, v = vx + i vy and f = e^{iwT}, v' = f v and
    z' = z + (f - 1) / (iw) v.
    """
    x, y, vx, vy = state
    if not rate:
        return x + vx * dt, y + vy * dt, vx, vy
    turned = exp(1j * rate * dt)
    v = complex(vx, vy)
    z, v = complex(x, y) + (turned - 1.0) / (1j * rate) * v, turned * v
    return z.real, z.imag, v.real, v.imag


def _whole_ns(t_s: float) -> float:
    """In whole nanoseconds, as a driver's steps are."""
    return round(t_s * 1e9) / 1e9
