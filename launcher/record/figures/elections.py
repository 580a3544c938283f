"""Elections of a run: who claimed to lead, who did, how long that took, and how long more than one led.

As in ``terms.py``, frames and points tell all of it.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from launcher.record.figures.terms import Claimed, Key, Seen
from trackfield.role import NS

APART_NS: Final = 3 * NS
"""Claims of one number are those of two elections if they are further apart than this,"""
APART_STEPS: Final = 3
"""and than so many steps: a slow radio takes that long to settle one."""


class Led(NamedTuple):
    """That a claimer led in the term of its election, and when it was first and last seen to do so."""

    leader: str
    begun_ns: int
    until_ns: int


class Election(NamedTuple):
    """The claims of one ``number``, the first at ``begun_ns``, and who led in the term of that number.

    ``claims`` are (id, key) in the order of sending; ``led`` are those of them that led, the first one first.
    """

    number: int
    begun_ns: int
    claims: tuple[tuple[str, int], ...]
    led: tuple[Led, ...] = ()

    @property
    def took_ns(self) -> int | None:
        """From the first claim until somebody led; None: nobody did."""
        return self.led[0].begun_ns - self.begun_ns if self.led else None

    @property
    def split(self) -> bool:
        """Whether more than one of the claimers led."""
        return len(self.led) > 1

    @property
    def healed_ns(self) -> int | None:
        """For how long more than one led, from the first poll or point of the second to the last one of the last but
        one; None if there was one leader at most.
        """
        if not self.split:
            return None
        return max(sorted(one.until_ns for one in self.led)[-2] - self.led[1].begun_ns, 0)


def elections(found: Seen, step_ns: int) -> list[Election]:
    """The elections of a run in their order.

    Claims of one number are one election as long as each follows another one soon. After that the same number is that
    of another election: of nodes that did not hear of the first one, or of one that nobody won.
    """
    by_number = defaultdict[int, list[Claimed]](list)
    for claim in sorted(found.claims):
        by_number[claim.number].append(claim)
    apart_ns = max(APART_NS, APART_STEPS * step_ns)
    apart = [one for claims in by_number.values() for one in _apart(claims, apart_ns)]
    led = {key: Led(key[1], found.first[key][0], found.until[key]) for key in found.elected()}
    return sorted((_election(led, claims, later) for claims, later in apart), key=lambda one: (one.begun_ns, one))


def _apart(claims: Sequence[Claimed], apart_ns: int) -> list[tuple[list[Claimed], int | None]]:
    """The claims of each election of one number, and when the next one of this number began (None: there is none)."""
    groups: list[list[Claimed]] = []
    for claim in claims:
        if not groups or claim.sent_ns - groups[-1][-1].sent_ns > apart_ns:
            groups.append([])
        groups[-1].append(claim)
    ends = [*(group[0].sent_ns for group in groups[1:]), None]
    return list(zip(groups, ends, strict=True))


def _election(led: Mapping[Key, Led], claims: Sequence[Claimed], later_ns: int | None) -> Election:
    number, begun_ns = claims[0].number, claims[0].sent_ns
    keys: dict[str, int] = {}
    for claim in claims:
        keys.setdefault(claim.src, claim.key)
    won = [led[number, id] for id in keys if (number, id) in led]
    own = [one for one in won if begun_ns <= one.begun_ns and (later_ns is None or one.begun_ns < later_ns)]
    return Election(number, begun_ns, tuple(keys.items()), tuple(sorted(own, key=lambda one: (one.begun_ns, one))))


def election_metrics(found: Sequence[Election]) -> dict[str, Any]:
    """Those keys of ``leaders`` in metrics.json that are about elections; times in s."""
    return {
        "elections": len(found),
        "split_elections": sum(one.split for one in found),
        "unwon_elections": sum(not one.led for one in found),
        "election_s": _spread([one.took_ns for one in found]),
        "healed_s": _spread([one.healed_ns for one in found]),
    }


def _spread(times_ns: Sequence[int | None]) -> Mapping[str, float | None]:
    """Mean and maximum (s) of the times that are there."""
    known = np.array([t_ns for t_ns in times_ns if t_ns is not None], float) / NS
    return {"mean": float(known.mean()), "max": float(known.max())} if len(known) else {"mean": None, "max": None}
