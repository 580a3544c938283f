"""Where a recording jumps: stretches between two fixes that no motion explains, and no usual error of the recording.

A receiver that was wrong for a while and corrects itself, or one bad fix, shows as a speed that no neighbour supports:
the mean velocity of one interval differs from those of the intervals before and after it, which agree with each other.
A manoeuvre is not like that: a target that brakes or turns goes on with the velocity that it has come to.

All three must hold of an interval for it to be a jump.

1. It takes more acceleration than ``MOST_M_S2``. With a the acceleration, the interval's mean velocity less the one
   that its neighbours give for its middle is the integral of K a, where K is a known function of time (``_judged``). So
   if a stays below A, the difference stays below A times the integral of |K|, whatever the target does; equality is
   full acceleration forth and back within the interval. Braking that sets in and lasts reaches a third of that, a turn
   at a steady rate less than all of it.
2. It stands out from the errors that the recording has all the time. The distance by which the target is off after the
   interval is more than ``OUTSTANDING`` times the median of those around it (Hampel 1974: the median is not moved by
   outliers). Of the length of a vector of two normal errors of one sd, c times the median is exceeded with the
   probability 2^-(c^2): here once in 65,000 intervals.
3. It is off by ``LEAST_M`` at least: satellite receivers are wrong by metres all the time. With several fixes a second
   a centimetre takes a large acceleration, and whoever walks has it.

The worst is found first, and the others are then judged without it: otherwise the neighbours of a jump would seem to be
wrong, too.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

MOST_M_S2: Final = 5.0
"""What UN Regulation 13 (annex 4, class M3) has a bus's brakes reach. To do that and its opposite within an interval is
beyond vehicles of any kind on a road."""

OUTSTANDING: Final = 4.0

LEAST_M: Final = 1.0

_AROUND: Final = 10
"""The number of intervals on either side that say what is usual."""

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Indices = NDArray[np.intp]


def jumps(t: Array, xy: Array, gap: Mask) -> Mask:
    """Which of the intervals (n-1,) between fixes ``xy`` (n, 2) in metres at times ``t`` (n,) in s are jumps.

    ``gap`` (n-1,) are the intervals without data, which say nothing about their neighbours.
    """
    found = np.zeros(len(gap), bool)
    while True:
        left = np.flatnonzero(~found)
        judged = _judged(t, xy, gap, left)
        wrong = (judged.needed > MOST_M_S2) & (judged.off > np.fmax(OUTSTANDING * _usual(judged.off), LEAST_M))
        beside = np.pad(judged.needed, 1, constant_values=-np.inf)
        worst = wrong & (judged.needed >= np.fmax(beside[:-2], beside[2:]))
        if not worst.any():
            return found
        found[left[_to_blame(np.flatnonzero(worst), judged.needed)]] = True


class _Judged(NamedTuple):
    """Of intervals (k,): the acceleration that is ``needed`` at least (m/s^2), and how far ``off`` the target is after
    it (m); NaN for those that cannot be judged."""

    needed: Array
    off: Array


def _judged(t: Array, xy: Array, gap: Mask, left: Indices) -> _Judged:
    """The intervals ``left`` (k,), each beside the nearest others of them.

    K falls from 0 before the interval by its neighbour's share of the expected velocity, passes through it from
    1 - w to -w, and goes back to 0 in the interval after it; where others were left out in between it is constant.
    """
    begin, end = t[left], t[left + 1]
    length, middle = end - begin, (begin + end) / 2.0
    velocity = (xy[left + 1] - xy[left]) / length[:, None]
    needed, off = np.full(len(left), np.nan), np.full(len(left), np.nan)
    apart = np.cumsum(np.append(0, gap))[left + 1]  # differs for intervals on two sides of a gap
    which = np.flatnonzero(~gap[left][1:-1] & (apart[:-2] == apart[2:])) + 1
    if len(which):
        before, after = which - 1, which + 1
        w = (middle[which] - middle[before]) / (middle[after] - middle[before])
        expected = (1.0 - w)[:, None] * velocity[before] + w[:, None] * velocity[after]
        extra = np.hypot(*(velocity[which] - expected).T)
        forth = (1.0 - w) * (length[before] / 2.0 + begin[which] - end[before])
        back = w * (length[after] / 2.0 + begin[after] - end[which])
        inside = length[which] * (np.square(1.0 - w) + np.square(w)) / 2.0
        needed[which], off[which] = extra / (forth + inside + back), extra * length[which]
    return _Judged(needed, off)


def _to_blame(worst: Indices, needed: Array) -> Indices:
    """The intervals (w,) that jump, where the ``worst`` (w,) do not agree with their neighbours.

    An interval without a neighbour on one side has no judgement of its own. If it jumps, so much is needed of the one
    beside it, and nothing of the next; if that one jumps, half as much is needed of the next.
    """
    before, after = needed[worst - 1], needed[worst + 1]
    first = np.isnan(before) & (after < needed[worst] / 4.0)
    last = np.isnan(after) & (before < needed[worst] / 4.0)
    return worst - first + last


def _usual(off: Array) -> Array:
    """The median (k,) of ``off`` (k,) over each interval and those around it; NaN where none of them was judged."""
    windows = sliding_window_view(np.pad(off, _AROUND, constant_values=np.nan), 2 * _AROUND + 1)
    usual = np.full(len(off), np.nan)
    known = np.isfinite(windows).any(axis=-1)
    usual[known] = np.nanmedian(windows[known], axis=-1)
    return usual
