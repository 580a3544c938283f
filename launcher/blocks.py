"""How a field is divided among hosts: contiguous blocks of its processes, in the order of a space-filling curve."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Final, NamedTuple

from trackfield.errors import ScenarioError

_LEVELS: Final = 16
"""The curve divides the field into squares of 2**-16 of its longer side."""


_MOST_RUNS: Final = 6


class Standing(NamedTuple):
    """A process and where it stands at the start (m)."""

    id: str
    x: float
    y: float


def blocks(field: Iterable[Standing], of: int) -> tuple[tuple[str, ...], ...]:
    """The ids of the processes of each of ``of`` blocks, whose sizes differ by one at most.

    Neighbours along a Hilbert curve are neighbours in the field, so most of what processes send each other stays within
    a block. Raises ``ScenarioError`` if there are fewer processes than blocks.
    """
    standing = sorted(field)
    if not 1 <= of <= len(standing):
        expected = f"1 to {len(standing)}, as many as there are processes on the field"
        raise ScenarioError(f"is {of}", key="the number of slices", expected=expected)
    ordered = _along_the_curve(standing)
    share, more = divmod(len(ordered), of)
    ends = [(share + 1) * min(i, more) + share * max(i - more, 0) for i in range(of + 1)]
    return tuple(tuple(ordered[a:b]) for a, b in pairwise(ends))


def number_of(index: int, of: int) -> int:
    """The number, 1 to ``of``, of the slice with this index: engines that count from 0 and from 1 mean the same ones.

    0 and ``of`` are the same, and have the last block.
    """
    return index % of or of


def span(ids: Iterable[str]) -> str:
    """Ids in a few words: of those that count on, the first and the last."""
    runs: list[list[str]] = []
    for id in sorted(ids, key=_counted):
        if runs and _counted(id) == (_counted(runs[-1][-1])[0], _counted(runs[-1][-1])[1] + 1):
            runs[-1].append(id)
        else:
            runs.append([id])
    told = [run[0] if len(run) == 1 else f"{run[0]}{', ' if len(run) == 2 else '..'}{run[-1]}" for run in runs]
    return ", ".join(told[:_MOST_RUNS]) + (", ..." if len(told) > _MOST_RUNS else "")


def _counted(id: str) -> tuple[str, int]:
    """What an id begins with, and the number at its end, or -1."""
    name = id.rstrip("0123456789")
    return name, int(id[len(name) :] or -1)


def _along_the_curve(standing: Sequence[Standing]) -> list[str]:
    left, low = min(one.x for one in standing), min(one.y for one in standing)
    side = max(max(one.x for one in standing) - left, max(one.y for one in standing) - low) or 1.0
    cells = 2**_LEVELS - 1

    def place(one: Standing) -> tuple[int, str]:
        return _hilbert(int((one.x - left) / side * cells), int((one.y - low) / side * cells)), one.id

    return [id for _, id in sorted(map(place, standing))]


def _hilbert(x: int, y: int) -> int:
    """How far along a Hilbert curve this square is (Warren, Hacker's Delight, 2nd ed., section 16-2)."""
    far, half = 0, 2 ** (_LEVELS - 1)
    while half:
        right, upper = int(bool(x & half)), int(bool(y & half))
        far += half * half * ((3 * right) ^ upper)
        if not upper:
            if right:
                x, y = 2**_LEVELS - 1 - x, 2**_LEVELS - 1 - y
            x, y = y, x
        half //= 2
    return far
