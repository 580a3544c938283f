"""Protocols of peers that answer each other: a party of a seed, its radio, and what befalls it."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from launcher.records import Plan
from tests.campaign.draws import LINKS, Draw
from tests.protocols.hardships import DEEDS, befallen, cut, off
from tests.protocols.parties import PARTIES
from tests.test_drivers_agree import toy_plan

SIZES: Final = {
    "election": (3, 16),
    "relay": (2, 6),
    "ring": (2, 9),
    "hosted": (2, 4),
    "dozing": (2, 6),
    "collection": (2, 12),
}
"""The fewest and the most processes of each protocol."""


def plan(protocol: str, seed: int) -> Plan:
    """The party of a seed; half of them have a link with delays of a few milliseconds, the others any radio."""
    draw = Draw(f"{protocol} {seed}")
    naps = {"naps": draw.random() < 0.5} if protocol == "election" else {}
    loss = draw.choice([0.0, draw.number(0, 0.5)])
    size, seconds = draw.randint(*SIZES[protocol]), draw.randint(5, 12)
    run, processes = PARTIES[protocol](seed, size=size, seconds=seconds, loss=loss, **naps)
    for link in draw.maybe(0.5, lambda: LINKS[draw.choice(sorted(LINKS))](draw)):
        run = replace(run, queues={"field": link.pop("queue", run.queue())}, link=link)
    if draw.random() < 0.6:
        processes = [off(process, draw) for process in processes]
    party = befallen((run, processes), draw, draw.choices(list(DEEDS), k=draw.randint(0, 6)))
    return toy_plan(*(cut(party, draw) if draw.random() < 0.3 else party))
