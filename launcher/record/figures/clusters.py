"""Which slaves had which masters, and which had none."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from typing import Any, Final

from launcher.record.diary import Diary
from launcher.record.ledger import Ledger
from launcher.records import JOINED, MASTER, SENSES, SLAVE, MessageRow, Plan
from trackfield.drivers.engine.frames import RANK_FRAME
from trackfield.protocols.association.joining import NO_PLACE
from trackfield.role import State
from trackfield.wire.clusters import Admit
from trackfield.wire.codec import decoded

NOTHING: Final[Mapping[str, Any]] = {"members": {}, "orphans_first": None, "orphans_last": None, "overheard": 0}


def clusters_metrics(plan: Plan, ledger: Ledger) -> dict[str, Any]:
    """``clusters`` of metrics.json; null and empty where there are no slaves.

    A slave's master is the one that answered it last; whether it has it still, its own state says. The dead count
    neither as members nor as orphans.
    """
    slaves = [place.id for place in plan.info.places if place.role == SLAVE]
    if not slaves:
        return dict(NOTHING)
    masters, overheard = admitted(plan, ledger.rows)
    first, last = (_states(ledger, slaves, t_ns) for t_ns in (plan.origin_ns, ledger.run.end_ns))
    members = defaultdict[str, list[str]](list)
    for id, state in last.items():
        if state in JOINED and id in masters:
            members[masters[id]].append(id)
    return {
        "members": {place.id: members[place.id] for place in plan.info.places if place.role == MASTER},
        "orphans_first": sum(state not in JOINED for state in first.values()),
        "orphans_last": sum(state not in JOINED for state in last.values()),
        "overheard": overheard,
    }


def admitted(plan: Plan, rows: Iterable[MessageRow]) -> tuple[dict[str, str], int]:
    """The master that last gave each slave a place, and how many answers came to slaves that were for others."""
    numbers = {place.id: number for number, place in enumerate(plan.info.tagged(SENSES))}
    found: dict[str, tuple[int, str]] = {}
    overheard, known = 0, dict[bytes, Any]()
    for row in rows:
        if row.kind != "admit" or row.dst not in numbers or not row.delivered or row.due_ns is None:
            continue
        admit = known[row.payload] = known.get(row.payload) or decoded(row.payload)
        if not isinstance(admit, Admit):
            continue
        if admit.sensor != numbers[row.dst]:
            overheard += 1
        elif row.outcome == "delivered" and admit.place != NO_PLACE:
            found[row.dst] = max(found.get(row.dst, (-1, "")), (row.due_ns, row.src))
    return {id: master for id, (_, master) in found.items()}, overheard


def _states(ledger: Ledger, ids: Iterable[str], t_ns: int) -> dict[str, str]:
    """The state of each of these processes at this time, of those that are alive then."""
    lives = defaultdict[str, list[Diary]](list)
    for diary in ledger.diaries.values():
        lives[diary.spec.id].append(diary)
    found = {}
    for id in ids:
        alive = next((one for one in lives[id] if one.owns(t_ns)), None)
        if alive is not None and (alive.died is None or alive.died > (t_ns, RANK_FRAME)):
            said = [told.effect.name for told in alive.told if isinstance(told.effect, State) and told.key[0] <= t_ns]
            found[id] = said[-1] if said else ""
    return found
