"""Reports that reach the leader over another master: the share of them that does, in time."""

from __future__ import annotations

import numpy as np

from launcher.plan.forecast.heard import Array, Heard
from launcher.plan.forecast.masters.scheduled import Scheduled, aggregate_bytes
from launcher.plan.forecast.masters.turns import Turn
from trackfield.role import NS


def relayed(field: Scheduled, ids: list[str], heard: Heard) -> Array:
    """(n,) the share of reports that their master has and that the leader gets before the deadline; of its own all."""
    turns = {turn.t_ns: turn for turn in field.turns.values()}
    masters, known = field.association.masters, dict[tuple[int, str], float]()
    shares = np.ones(len(heard.t_ns))
    for row, (t_ns, sensor) in enumerate(zip(heard.t_ns.tolist(), heard.sensor.tolist(), strict=True)):
        key = t_ns, masters[ids[sensor]]
        if key not in known:
            known[key] = _share(field, turns[t_ns], key[1])
        shares[row] = known[key]
    return shares


def _share(field: Scheduled, turn: Turn, master: str) -> float:
    if master == turn.leader:
        return 1.0
    size, radio = aggregate_bytes(len(turn.sensors[master]), field.sizes["report"]), field.radio
    takes_ns = 0 if radio is None else radio.airtime_ns(min(size, radio.payload_bytes) + radio.overhead_bytes)
    if turn.gathered[master] * field.schedule.slot_ns + takes_ns > field.plan.deadline_s * NS:
        return 0.0
    return field.link.reception(master, turn.leader, size, "aggregate")
