"""Ways over links from one process to the next, and the groups that these make."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from typing import Any

import numpy as np

Pair = tuple[str, str]


def next_of(costs: Mapping[Pair, float], bases: Collection[str]) -> dict[str, str]:
    """The next process on the way of least cost to any of the ``bases``, by id, of all who have a way.

    ``costs`` are those of the directed links, above 0.
    """
    from scipy.sparse.csgraph import dijkstra

    ids = sorted({*bases, *(id for pair in costs for id in pair)})
    indices = [ids.index(base) for base in sorted(bases)]
    _, before, _ = dijkstra(_matrix(ids, costs).T, indices=indices, min_only=True, return_predecessors=True)
    return {id: ids[i] for id, i in zip(ids, before.tolist(), strict=True) if i >= 0}


def groups(ids: Iterable[str], links: Iterable[Pair]) -> list[list[str]]:
    """The groups of those who reach each other, in either direction and over others; the largest first."""
    from scipy.sparse.csgraph import connected_components

    names = sorted(ids)
    count, labels = connected_components(_matrix(names, dict.fromkeys(links, 1.0)), directed=False)
    members = [[names[i] for i in np.flatnonzero(labels == label)] for label in range(count)]
    return sorted(members, key=lambda each: (-len(each), each))


def _matrix(ids: list[str], costs: Mapping[Pair, float]) -> Any:
    """(n, n) sparse: what a link costs from the one in its row to the one in its column."""
    from scipy.sparse import csr_array

    number = {id: i for i, id in enumerate(ids)}
    ends = np.array([(number[src], number[dst]) for src, dst in costs], np.intp).reshape(-1, 2).T
    return csr_array((np.array([*costs.values()], float), (ends[0], ends[1])), shape=(len(ids), len(ids)))
