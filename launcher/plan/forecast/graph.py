"""Whether the links of a field hold it together: who can reach a base over others, and which groups there are."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from typing import Final

from launcher.plan.forecast.reception import shares_of
from launcher.plan.forecast.ways import Pair, groups, next_of
from launcher.records import SENSES, Plan
from trackfield.errors import ScenarioError
from trackfield.link.fate import FIELD

CARRIES: Final = 0.5
"""A link that delivers at least this share of its messages is one of the graph."""
FEW: Final = 5
"""So many of those who are cut off are named."""


def cut_off(ids: Iterable[str], links: Iterable[Pair], bases: Collection[str]) -> list[str]:
    """Those of ``ids`` from whom no way along directed links leads to any of the ``bases``."""
    return sorted(set(ids) - set(bases) - next_of(dict.fromkeys(links, 1.0), bases).keys())


def links_of(plan: Plan, medium: str = FIELD, among: Collection[str] = ()) -> Mapping[Pair, float]:
    """The links between those who send to all in reach of them that belong to the graph, with what they deliver.

    ``among`` are both ends of the links that count; empty: all do.
    """
    inside, found = set(among), dict[Pair, float]()
    for one in plan.flows:
        if one.near and one.medium == medium:
            flow = replace(one, pairs=tuple(filter(inside.issuperset, one.pairs))) if inside else one
            found |= {pair: share for pair, share in shares_of(plan, flow, None).items() if share >= CARRIES}
    return found


def check_reach(plan: Plan, bases: Collection[str], medium: str = FIELD) -> None:
    """Raise ``ScenarioError`` unless all who are in a tree to a base can reach it over such links.

    For architectures whose messages go to a base from one to the next, and where no process is in a tree for every
    sensor and all who pass messages on; planned faults are left out.
    """
    ids = {process.id for process in plan.processes if process.tree}
    links = links_of(plan, medium, ids)
    if not ids:
        ids = {place.id for place in plan.info.tagged(SENSES)} | {id for pair in links for id in pair}
    ids -= set(bases)
    lost = cut_off(ids, links, bases)
    if not lost:
        return
    others = [group for group in groups(ids | set(bases), links) if not set(group) & set(bases)]
    named = ", ".join(lost[:FEW]) + (f" and {len(lost) - FEW} more" if len(lost) > FEW else "")
    apart = f"; they are {len(others)} groups apart from every base" if len(others) > 1 else ""
    what = f"{len(lost)} of {len(ids)} processes cannot reach {' or '.join(sorted(bases))} by radio ({named}){apart}"
    expected = (
        f"links that deliver at least {CARRIES:.0%} of the messages, from one to the next: more power, nodes or bases"
    )
    raise ScenarioError(what, key="link" if medium == FIELD else medium, expected=expected)
