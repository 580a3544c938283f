"""What is shown of a run at each instant: pictures on a raster of time, sums per second, shapes."""

from __future__ import annotations

import heapq
import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from launcher.records import FieldInfo, MessageRow
from trackfield.role import NS

RASTER_NS: Final = 50_000_000
"""Instants at which the picture of field and network may change."""

Points = npt.NDArray[np.float64]
Add = Callable[[str, Callable[[list[Any]], Any], int, Any], None]
"""Takes a row: entity, its columns (``rows``), time, value."""
_Change = tuple[float, int, str, Any, Any, float]
"""Time, order of the call, kind, key, value, end; at its end a change comes once more."""


class Shown:
    """What is shown at an instant, by kind and key; calls come in any order, changes on the raster.

    ``now`` holds what is shown after the last instant that ``until`` gave, which is ``last_ns``.
    """

    def __init__(self) -> None:
        self.now: defaultdict[str, dict[Any, Any]] = defaultdict(dict)
        self.last_ns = 0
        self._ends: dict[tuple[str, Any], float] = {}
        self._changes: list[_Change] = []
        self._count = 0

    def show(self, kind: str, key: Any, value: Any, begin_ns: int, end_ns: float = math.inf) -> None:
        """Show the value of this key in [begin, end), or until another one begins; None: show nothing."""
        if begin_ns < end_ns:
            self._count += 1
            heapq.heappush(self._changes, (begin_ns, self._count, kind, key, value, end_ns))

    def until(self, t_ns: float) -> Iterator[tuple[int, dict[str, set[Any]]]]:
        """Applies the changes up to a time; yields each instant and the keys that changed, by kind."""
        while self._changes and self._changes[0][0] <= t_ns:
            self.last_ns = max(self.last_ns, -(-int(self._changes[0][0]) // RASTER_NS) * RASTER_NS)
            changed: defaultdict[str, set[Any]] = defaultdict(set)
            while self._changes and self._changes[0][0] <= self.last_ns:
                self._apply(heapq.heappop(self._changes), changed)
            yield self.last_ns, changed

    def _apply(self, change: _Change, changed: defaultdict[str, set[Any]]) -> None:
        t_ns, count, kind, key, value, end_ns = change
        shown = self.now[kind]
        if t_ns >= end_ns:
            if self._ends.get((kind, key)) != end_ns:
                return  # another value has begun
            value = None
        ended = self._ends.pop((kind, key), None)
        if end_ns == math.inf and ended is None and shown.get(key) == value:
            return
        if value is None:
            shown.pop(key, None)
        else:
            shown[key] = value
            if end_ns < math.inf:
                self._ends[kind, key] = end_ns
                heapq.heappush(self._changes, (end_ns, count, kind, key, None, end_ns))
        changed[kind].add(key)


@dataclass(slots=True)
class _Second:
    expected: int = 0
    delivered: int = 0
    lost: int = 0
    late: int = 0
    waiting: int = 0
    delays_ms: list[float] = field(default_factory=list)
    errors_ms: list[float] = field(default_factory=list)


class Seconds:
    """Sums over each emulated second, for the plots; late values count in the first second that is still open."""

    def __init__(self) -> None:
        self._open: defaultdict[int, _Second] = defaultdict(_Second)
        self._next = self._lost = self._late = 0

    def message(self, t_ns: int, row: MessageRow) -> None:
        """Adds a message to the second in which it arrived."""
        second = self._second(t_ns)
        second.expected += row.bytes
        second.late += row.outcome == "late"
        if not row.delivered:
            second.lost += 1
            return
        second.delivered += row.bytes
        if row.due_ns is not None:
            second.delays_ms.append((row.due_ns - row.sent_ns) / 1e6)

    def clock(self, t_ns: int, error_ms: float) -> None:
        """Adds a clock error."""
        self._second(t_ns).errors_ms.append(error_ms)

    def queue(self, t_ns: int, waiting: int) -> None:
        """Adds the number of frames that wait at a radio."""
        second = self._second(t_ns)
        second.waiting = max(second.waiting, waiting)

    def until(self, t_ns: float) -> Iterator[tuple[int, str, tuple[float, ...]]]:
        """(time, plot, values) of each second that ended by then; infinity: of all that are left.

        The values are lost and late frames so far; bytes per second sent to all receivers and delivered; the longest
        queue; the median and the 95 % point of the delays of delivered frames in ms; the root mean square and the
        largest size of the clocks' errors in ms.
        """
        while self._open if t_ns == math.inf else (self._next + 1) * NS <= t_ns:
            second = self._open.pop(self._next, _Second())
            self._next += 1
            self._lost += second.lost
            self._late += second.late
            end_ns = self._next * NS
            yield end_ns, "lost", (self._lost, self._late)
            yield end_ns, "bytes", (second.expected, second.delivered)
            yield end_ns, "queue", (second.waiting,)
            if second.delays_ms:
                yield end_ns, "latency", tuple(np.percentile(second.delays_ms, (50, 95)))
            if second.errors_ms:
                mean_square = math.fsum(error**2 for error in second.errors_ms) / len(second.errors_ms)
                yield end_ns, "clock", (math.sqrt(mean_square), max(map(abs, second.errors_ms)))

    def _second(self, t_ns: int) -> _Second:
        return self._open[max(t_ns // NS, self._next)]


class Sight(NamedTuple):
    """What readings are drawn with: the sensors' ``places`` (m), the latest ``fixes`` (m), and lengths (m).

    ``reach_m`` is how far a ray goes that no fix ends, ``spacing_m`` how far sensors are apart.
    """

    places: Mapping[str, tuple[float, float]]
    fixes: Iterable[tuple[float, float]]
    reach_m: float
    spacing_m: float


def rings(centre: Points, covariance: tuple[float, ...]) -> Points:
    """The outline of the 95 % region of a Gaussian, (1, 33, 2), or (0, 33, 2) where there is none.

    ``centre`` (1, 2) or (0, 2); ``covariance`` 4x4 row by row, position first.
    """
    if not len(centre):
        return np.empty((0, 33, 2))
    xx, xy, yy = covariance[0], covariance[1], covariance[5]
    a = math.sqrt(max(xx, 0.0))
    b = xy / a if a else 0.0
    root = np.array([[a, b], [0.0, math.sqrt(max(yy - b * b, 0.0))]])  # of Cholesky, for row vectors
    angle = np.linspace(0.0, 2 * math.pi, 33)
    # -2 ln(1 - 0.95) is the 95 % point of a chi-square with two degrees of freedom.
    circle = math.sqrt(-2 * math.log(0.05)) * np.column_stack((np.cos(angle), np.sin(angle)))
    return np.asarray(centre + circle @ root)[None]


def extent(info: FieldInfo) -> float:
    """The longer side of the area of all places, metres."""
    at = np.array([(place.x, place.y) for place in info.places])
    return float(np.max(np.ptp(at, axis=0)))


def spacing(info: FieldInfo) -> float:
    """How far a place typically is from the next one, metres; about 0 if all are at one point."""
    at = np.array(list(dict.fromkeys((place.x, place.y) for place in info.places)))
    if len(at) == 1:
        return 1e-3
    some = at[:: len(at) // 100 + 1]
    nearest = [np.partition(np.hypot(*(at - one).T), 1)[1] for one in some]  # a place is 0 m from itself
    return max(float(np.median(nearest)), 1e-3)


def crosses(at: Points, size: float | Points) -> Points:
    """Two strokes of a cross on each of these points (n, 2), (2n, 2, 2).

    They reach ``size`` metres to each side, one for all or (n,).
    """
    strokes = np.array([[(-1, -1), (1, 1)], [(-1, 1), (1, -1)]])
    return np.reshape(at[:, None, None] + np.reshape(size, (-1, 1, 1, 1)) * strokes, (-1, 2, 2))


def halves(info: FieldInfo) -> Points:
    """A line from sender to receiver for each link used, (n, 2, 2); to the middle only where both ends send."""
    at = {place.id: (place.x, place.y) for place in info.places}
    pairs = {(src, dst) for src, dst, _ in info.receptions}
    ends = np.reshape([(at[src], at[dst]) for src, dst, _ in info.receptions], (-1, 2, 2))
    both = np.array([(dst, src) in pairs for src, dst, _ in info.receptions], bool)
    ends[both, 1] = ends[both].mean(axis=1)
    return ends
