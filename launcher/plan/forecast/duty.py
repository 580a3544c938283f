"""Who sends for how long in an hour, beside what the band allows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from launcher.plan.forecast.heard import Heard, Indices
from launcher.plan.forecast.trial import Trial, Way
from launcher.records import Plan
from trackfield.drivers.spec import powers_of
from trackfield.link.radios import RADIOS
from trackfield.role import NS

HOUR_S: Final = 3600.0


@dataclass(frozen=True)
class Duty:
    """The node ``id`` sends ``what`` for so many ``seconds`` in its busiest hour, and ``allowed_s`` are allowed."""

    id: str
    what: str
    seconds: float
    allowed_s: float


def duties_of(plan: Plan, ids: list[str], heard: Heard, trial: Trial, ways: Mapping[str, Way]) -> tuple[Duty, ...]:
    """Whose reports, or acknowledgements, are longest on air in any hour, also those of others; one of each role."""
    if not len(trial.air_s):
        return ()
    shares = allowances(plan)
    roles, most = {place.id: place.role for place in plan.info.places}, dict[tuple[str, str], Duty]()
    for id, what, seconds in _on_air(ids, heard, trial, ways):
        duty = shares.get(id, 1.0)
        key = roles[id], what
        if duty < 1.0 and (key not in most or seconds > most[key].seconds):
            most[key] = Duty(id, what, seconds, duty * HOUR_S)
    return tuple(most.values())


def allowances(plan: Plan) -> Mapping[str, float]:
    """The share of any hour in which each process may send, by id; none where no rule limits that."""
    name = str(plan.run.link.get("radio"))
    if name not in RADIOS:
        return {}
    radio, own = RADIOS[name](plan.run.link.get("sf", 9)), powers_of(plan.processes)
    all_dbm = plan.run.link.get("tx_dbm")
    usual_dbm = radio.tx_dbm if all_dbm is None else float(all_dbm)
    return {place.id: radio.duty_at(own.get(place.id, usual_dbm)) for place in plan.info.places}


def _on_air(ids: list[str], heard: Heard, trial: Trial, ways: Mapping[str, Way]) -> Iterator[tuple[str, str, float]]:
    """Who sends reports, and acknowledgements of reports, for how long (s) in the busiest hour."""
    links = {id: way.tree.way(id, way.to) if way.tree else [(id, way.to)] for id, way in ways.items()}
    sent = [(row, link) for row, i in enumerate(heard.sensor.tolist()) for link in links[ids[i]]]
    if not sent:
        return
    names = list(dict.fromkeys((*ids, *sorted({name for _, link in sent for name in link}))))
    number = {name: i for i, name in enumerate(names)}
    t_ns = heard.t_ns[[row for row, _ in sent]]
    for what, air_s, end in (("reports", trial.air_s, 0), ("acknowledgements", trial.ack_s, 1)):
        each_s = float(air_s.mean()) * len(heard.t_ns) / len(sent)
        whose = np.array([number[link[end]] for _, link in sent], np.intp)
        if each_s:
            yield from ((names[i], what, n * each_s) for i, n in _busiest(t_ns, whose, heard.every))


def _busiest(at_ns: NDArray[np.int64], whose: Indices, every: int) -> list[tuple[int, int]]:
    """(owner, messages in its busiest hour) of each owner in ``whose``; one in ``every`` message is there."""
    order, hour = np.lexsort((at_ns, whose)), 3600 * NS
    owner, t_ns = whose[order].astype(np.int64), at_ns[order]
    span = int(t_ns.max()) + hour
    key = owner * span + t_ns  # one line of time, one owner after the other
    counts = (np.searchsorted(key, key + hour) - np.arange(len(key))) * every
    owners, first = np.unique(owner, return_index=True)
    most = np.maximum.reduceat(counts, first)
    return list(zip(owners.tolist(), most.tolist(), strict=True))
