"""Targets of nearly constant velocity whose acceleration is white noise: Özfidan et al. (2018), eqs. 1 to 6."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, radians, sin, sqrt
from typing import Final

from trackfield.draw import normal, uniform
from trackfield.models.motion import white_acceleration
from trackfield.world.path import Knot, Path

TRIES: Final = 5000
"""Paths that are drawn at most, to find one that stays."""
MOST_DRAWN: Final = 500_000
"""Steps that are drawn at most for that, of all paths together: some seconds."""


@dataclass(frozen=True, slots=True)
class Drift:
    """How such a target moves, and the square that it does not leave.

    ``q`` is the density of the acceleration's noise on each axis (m^2/s^3). The target starts at ``start`` (x, y in m)
    with ``speed_m_s`` in the direction ``heading_deg``, clockwise from north, None for any, drawn. The square has the
    start in its middle and sides of twice ``half_width_m``.
    """

    q: float
    speed_m_s: float
    heading_deg: float | None
    half_width_m: float
    start: tuple[float, float] = (0.0, 0.0)

    def path(self, seed: int, steps: int, step_s: float, id: str = "target") -> Path:
        """A path of so many steps that is in the square at each of them; another seed or ``id`` gives another path.

        The states at steps are exact draws of the motion. Between two of them the path is the cubic through both,
        which is the mean of all motions that have these two. One that leaves the square is drawn again as a whole, its
        heading too, so a longer path may be another one. Raises ``ValueError`` if none is found that stays.
        """
        drawn = 0
        for attempt in range(TRIES):
            knots = self._drawn(seed, steps, step_s, id, attempt)
            if len(knots) > steps:
                return Path.of(knots)
            drawn += len(knots)
            if drawn > MOST_DRAWN:
                break
        raise ValueError(f"{attempt + 1} paths of {steps} steps were drawn, and none stays within it")

    def _drawn(self, seed: int, steps: int, step_s: float, id: str, attempt: int) -> list[Knot]:
        """The knots of the ``attempt``-th path, the first at the start, as far as it is in the square."""
        half, (x0, y0), key = self.half_width_m, self.start, (id, 0, "drift", attempt)
        heading = 360.0 * uniform(seed, *key, "heading") if self.heading_deg is None else self.heading_deg
        x, y, vx, vy = x0, y0, self.speed_m_s * sin(radians(heading)), self.speed_m_s * cos(radians(heading))
        knots: list[Knot] = [(0.0, x, y, vx, vy)]
        (to_place, rest), (to_speed, _) = _root(step_s, self.q)
        for k in range(steps):
            a, b, c, d = (normal(seed, *key, what, k) for what in ("vx", "x", "vy", "y"))
            x, vx = x + vx * step_s + to_place * a + rest * b, vx + to_speed * a
            y, vy = y + vy * step_s + to_place * c + rest * d, vy + to_speed * c
            if abs(x - x0) > half or abs(y - y0) > half:
                break
            knots.append((round((k + 1) * step_s * 1e9) / 1e9, x, y, vx, vy))  # whole ns, as a driver's steps are
        return knots


def _root(dt: float, q: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """A root (2x2) of the noise of (place, velocity), whose first draw is the velocity's alone."""
    (place, both), (_, speed) = white_acceleration(dt, q)
    sd = sqrt(speed)
    shared = both / sd if sd else 0.0
    return (shared, sqrt(max(place - shared**2, 0.0))), (sd, 0.0)
