"""Where a target is at any time: a piecewise cubic through knots, evaluated without numpy.

Between two knots the position is the cubic Hermite polynomial that has the knots' positions and velocities,
which is exact for any stretch of constant acceleration. Two knots at one instant let the velocity jump.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from math import hypot
from typing import Any, Final, Self

Knot = tuple[float, float, float, float, float]
State = tuple[float, float, float, float]
Interval = tuple[float, float]

_NS: Final = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Path:
    """A target's path: knots at times ``t`` (s since the start of the run), never decreasing.

    ``x, y`` are metres east and north, ``vx, vy`` metres per second; one entry per knot. ``gaps`` are the
    (from s, to s) for which there was no data and a straight line stands in, ``jumps`` those between two fixes of which
    the recording is at fault: no target moved like that. ``missing`` are the numbers of the stretches between knots
    that a ``cut`` left out. Raises ``ValueError`` for columns that are empty or of
    unequal length, for decreasing times, and for a target at two places at once.
    """

    t: tuple[float, ...]
    x: tuple[float, ...]
    y: tuple[float, ...]
    vx: tuple[float, ...]
    vy: tuple[float, ...]
    gaps: tuple[Interval, ...] = ()
    jumps: tuple[Interval, ...] = ()
    missing: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if not self.t or {len(self.x), len(self.y), len(self.vx), len(self.vy)} != {len(self.t)}:
            raise ValueError("a path needs at least one knot, and as many of each coordinate")
        for a, b in pairwise(zip(self.t, self.x, self.y, strict=True)):
            if b[0] < a[0] or (b[0] == a[0] and b != a):
                raise ValueError(f"a path's knots go forward in time, or are at one place: {b} follows {a}")

    @classmethod
    def of(cls, knots: Iterable[Knot], gaps: Iterable[Interval] = (), jumps: Iterable[Interval] = ()) -> Self:
        """The path through these (t, x, y, vx, vy)."""
        t, x, y, vx, vy = zip(*knots, strict=True)
        return cls(t, x, y, vx, vy, tuple(gaps), tuple(jumps))

    @property
    def start_s(self) -> float:
        """When the target appears."""
        return self.t[0]

    @property
    def end_s(self) -> float:
        """When the target disappears."""
        return self.t[-1]

    def at(self, t_s: float) -> State | None:
        """(x, y, vx, vy) at this time; None where the target is not there, or in a stretch that was cut away.

        Where the velocity jumps, the one after the jump.
        """
        i = bisect_right(self.t, t_s) - 1
        if i < 0 or t_s > self.end_s:
            return None
        if t_s == self.t[i]:
            return self._knot(i)[1:]
        if i in self.missing:
            return None
        return _hermite(self._knot(i), self._knot(i + 1), t_s)

    @property
    def fastest_m_s(self) -> float:
        """The target's highest speed, of those at knots and midway between them."""
        knots = [self._knot(i) for i in range(len(self.t))]
        middles = [_hermite(a, b, (a[0] + b[0]) / 2.0) for a, b in pairwise(knots) if b[0] > a[0]]
        return max(hypot(vx, vy) for *_, vx, vy in (*knots, *middles))

    def interpolated(self, t_s: float) -> bool:
        """Whether this time lies inside a gap, where a straight line stands in for the truth, or in a jump.

        The ends of a gap are fixes, and count as truth. Those of a jump do not: it is not known which of them is wrong.
        """
        return self.jumping(t_s) or any(begin < t_s < end for begin, end in self.gaps)

    def jumping(self, t_s: float) -> bool:
        """Whether this time lies in a jump, its ends included."""
        return any(begin <= t_s <= end for begin, end in self.jumps)

    @property
    def gaps_inside(self) -> tuple[Interval, ...]:
        """The gaps, as far as the path reaches; one that was clipped has no fix at that end."""
        return self._as_far(self.gaps)

    @property
    def jumps_inside(self) -> tuple[Interval, ...]:
        """The jumps, as far as the path reaches."""
        return self._as_far(self.jumps)

    @property
    def guessed_inside(self) -> tuple[Interval, ...]:
        """Gaps and jumps, as far as the path reaches, in order."""
        return tuple(sorted(self.gaps_inside + self.jumps_inside))

    def clip(self, from_s: float, to_s: float) -> Path:
        """The part of a whole path between two times, with knots at its ends; a gap that it cuts stays whole.

        Raises ``ValueError`` if the target is there at no time between them.
        """
        lo, hi = max(from_s, self.start_s), min(to_s, self.end_s)
        first, last = self.at(lo), self.at(hi)
        if lo > hi or first is None or last is None:
            raise ValueError(f"the path has nothing between {from_s} s and {to_s} s")
        knots = [self._knot(i) for i in range(bisect_left(self.t, lo), bisect_right(self.t, hi))]
        if not knots or knots[0][0] > lo:
            knots.insert(0, (lo, *first))
        if knots[-1][0] < hi:
            knots.append((hi, *last))
        jumps = ((a, b) for a, b in self.jumps if a <= hi and b >= lo)
        return Path.of(knots, ((a, b) for a, b in self.gaps if a < hi and b > lo), jumps)

    def hastened(self, factor: float) -> Path:
        """A whole path, gone along so many times as fast; t=0 stays where it is."""
        if factor == 1:
            return self
        knots = (
            (t / factor, x, y, factor * vx, factor * vy) for t, x, y, vx, vy in map(self._knot, range(len(self.t)))
        )
        gaps, jumps = (((a / factor, b / factor) for a, b in some) for some in (self.gaps, self.jumps))
        return Path.of(knots, gaps, jumps)

    def shifted(self, seconds: float) -> Path:
        """A whole path, later by ``seconds``, in whole nanoseconds; 0 returns the path itself.

        If knots at different places fall on one instant, the first is kept.
        """
        if not seconds:
            return self

        def later(t_s: float) -> float:
            return (round(t_s * _NS) + round(seconds * _NS)) / _NS

        knots: list[Knot] = []
        for i, t in enumerate(self.t):
            knot = (later(t), *self._knot(i)[1:])
            if not knots or knot[0] > knots[-1][0] or knot[:3] == knots[-1][:3]:
                knots.append(knot)
        gaps, jumps = (((later(a), later(b)) for a, b in some) for some in (self.gaps, self.jumps))
        return Path.of(knots, gaps, jumps)

    def cut(self, intervals: Iterable[Interval]) -> Path:
        """The part of the path that gives the same ``at`` inside these (from s, to s), bit for bit, as the whole.

        Used to send a node only what it needs of the path.
        """
        keep: set[int] = set()
        for a, b in intervals:
            keep.update(range(max(bisect_left(self.t, a) - 1, 0), min(bisect_right(self.t, b), len(self.t) - 1)))
        keep -= set(self.missing)
        knots = sorted(keep | {i + 1 for i in keep}) or [0]
        missing = tuple(n for n, i in enumerate(knots[:-1]) if i not in keep)
        columns = {name: tuple(getattr(self, name)[i] for i in knots) for name in ("t", "x", "y", "vx", "vy")}
        return replace(self, **columns, missing=missing)

    def to_plain(self) -> dict[str, Any]:
        """Lists of numbers, for a message or a file; the floats stay exact."""
        return {
            "knots": [list(column) for column in (self.t, self.x, self.y, self.vx, self.vy)],
            "gaps": [list(gap) for gap in self.gaps],
            "jumps": [list(jump) for jump in self.jumps],
            "missing": list(self.missing),
        }

    @classmethod
    def from_plain(cls, plain: Mapping[str, Any]) -> Self:
        """The inverse of ``to_plain``."""
        t, x, y, vx, vy = map(tuple, plain["knots"])
        gaps, jumps = (tuple((a, b) for a, b in plain[name]) for name in ("gaps", "jumps"))
        return cls(t, x, y, vx, vy, gaps, jumps, tuple(plain["missing"]))

    def _as_far(self, intervals: Iterable[Interval]) -> tuple[Interval, ...]:
        return tuple((max(a, self.start_s), min(b, self.end_s)) for a, b in intervals)

    def _knot(self, i: int) -> Knot:
        return self.t[i], self.x[i], self.y[i], self.vx[i], self.vy[i]


def _hermite(begin: Knot, end: Knot, t_s: float) -> State:
    """The cubic that has both knots' positions and velocities, at a time strictly between them."""
    (t0, x0, y0, vx0, vy0), (t1, x1, y1, vx1, vy1) = begin, end
    h, s = t1 - t0, t_s - t0
    mean_x, mean_y = (x1 - x0) / h, (y1 - y0) / h
    x2, x3 = (3.0 * mean_x - 2.0 * vx0 - vx1) / h, (vx0 + vx1 - 2.0 * mean_x) / (h * h)
    y2, y3 = (3.0 * mean_y - 2.0 * vy0 - vy1) / h, (vy0 + vy1 - 2.0 * mean_y) / (h * h)
    return (
        x0 + s * (vx0 + s * (x2 + s * x3)),
        y0 + s * (vy0 + s * (y2 + s * y3)),
        vx0 + s * (2.0 * x2 + 3.0 * s * x3),
        vy0 + s * (2.0 * y2 + 3.0 * s * y3),
    )
