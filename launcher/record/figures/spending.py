"""What the batteries of a field spend, on what, in each period of a run; and how long they last if no target is there
for most of the time.

The meters of processes tell what each spent in all. It is divided among the periods and purposes by what the recorder
knows of each process: its frames and their lengths, and when its receiver was open.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import ceil
from typing import Any, Final

from launcher.record.diary import Diary
from launcher.record.figures.energy import Battery
from launcher.record.figures.overhearing import Overheard
from launcher.record.figures.periods import IDLE, PERIODS, PRESENT, SETTLING, SETUP, Span, spans_of
from launcher.record.ledger import SYNCHRONISING, Ledger
from launcher.records import Plan
from trackfield.drivers.engine.meter import Activity
from trackfield.drivers.engine.receiver import open_ns
from trackfield.link.energy import Power
from trackfield.role import NS
from trackfield.wire.codec import kind_name

SYNC: Final = "sync"
REPORTS: Final = "reports"
CONTROL: Final = "control"
PURPOSES: Final = (SYNC, REPORTS, CONTROL, "overhear", "listen", "sleep", "sense")
"""Frames that set clocks, those that carry reports, and all others, sent and received; frames for others that an open
receiver hears, and waiting for any; the rest of the time; readings."""
SHARE_PRESENT: Final = 0.01
"""The share of its life in which a field has a target, of ``lifetime_s`` below."""
_HEADER: Final = 17
"""Bytes that a frame is longer than its payload, where the link has no radio."""
_FJ: Final = 1e-15
Shares = Mapping[str, float]
Node = dict[str, dict[str, float]]
"""J by period and purpose."""


def ledger_metrics(plan: Plan, ledger: Ledger, batteries: Sequence[Battery], heard: Overheard) -> dict[str, Any]:
    """``ledger`` of metrics.json; no energies where none is metered."""
    spans = spans_of(plan, ledger.run.end_ns)
    lasted = {period: sum(s.end_ns - s.begin_ns for s in spans if s.period == period) / NS for period in PERIODS}
    use = _Use.of(plan, ledger, spans)
    nodes = {one.spec.id: _spent(one, use, heard) for one in batteries}
    whole = {period: _period(period, lasted[period], use, nodes.values()) for period in PERIODS}
    alive = [(one, nodes[one.spec.id]) for one in batteries if not one.killed]
    return {
        **whole,
        "power_w": {period: _power(whole[period]) for period in (PRESENT, IDLE)},
        "hottest": _hottest([sum(node[PRESENT].values()) for _, node in alive]),
        "share_present": SHARE_PRESENT,
        "lifetime_s": _lifetimes([_lifetime(one, node, lasted) for one, node in alive]),
    }


def period_of(spans: Sequence[Span]) -> Callable[[int], str]:
    """In which of the periods an instant (ns) is."""
    begins = [span.begin_ns for span in spans]
    return lambda at_ns: spans[max(bisect_right(begins, at_ns) - 1, 0)].period if spans else SETTLING


# --- what processes did, and when -------------------------------------------------------------------------------------


def _table() -> defaultdict[tuple[str, str], defaultdict[tuple[str, str], float]]:
    return defaultdict(lambda: defaultdict(float))


@dataclass
class _Use:
    """What processes did, by (id, medium): bytes ``sent`` and ``received`` by (period, purpose), ``open`` receivers
    (ns) and ``lived`` (ns) by period. ``bytes`` are those that all sent by period."""

    sent: dict[tuple[str, str], Any] = field(default_factory=_table)
    received: dict[tuple[str, str], Any] = field(default_factory=_table)
    open: dict[tuple[str, str], dict[str, float]] = field(default_factory=dict)
    lived: dict[str, dict[str, float]] = field(default_factory=dict)
    bytes: defaultdict[str, int] = field(default_factory=lambda: defaultdict(int))

    @classmethod
    def of(cls, plan: Plan, ledger: Ledger, spans: Sequence[Span]) -> _Use:
        """Of a run that is settled."""
        use, period, purpose = cls(), period_of(spans), _purposes(plan)
        for one in ledger.sendings:
            size = one.on_air or one.size + _HEADER
            use.sent[one.src, one.medium][period(one.sent_ns), purpose(one.kind)] += size
            use.bytes[period(one.sent_ns)] += one.on_air or one.size
        for row in ledger.rows:
            if row.delivered:
                use.received[row.dst, row.medium][period(row.sent_ns), purpose(row.kind)] += row.bytes + _HEADER
        for diary in ledger.diaries.values():
            use._live(diary, spans, ledger.run.end_ns)
        return use

    def _live(self, diary: Diary, spans: Sequence[Span], end_ns: int) -> None:
        """Add when a life was there, and when its receivers were open."""
        spec = diary.spec
        died_ns = end_ns if diary.died is None else diary.died[0]
        until_ns = min(end_ns, died_ns, end_ns if spec.kill_ns is None else spec.kill_ns)
        lived = self.lived.setdefault(spec.id, dict.fromkeys(PERIODS, 0.0))
        for span in spans:
            lived[span.period] += max(min(until_ns, span.end_ns) - max(spec.start_ns, span.begin_ns), 0)
        if not spec.power:
            return
        for medium in spec.powers:
            opened = self.open.setdefault((spec.id, medium), dict.fromkeys(PERIODS, 0.0))
            changes = diary.awake(medium)
            ends = [t for t, _ in changes[1:]] + [until_ns]
            for (begin_ns, opening), change_ns in zip(changes, ends, strict=True):
                for span in spans if opening is not False else ():
                    a, b = max(begin_ns, span.begin_ns), min(change_ns, span.end_ns, until_ns)
                    if a < b:
                        opened[span.period] += open_ns(opening, a, b)


def _purposes(plan: Plan) -> Callable[[str], str]:
    """What frames of a kind are for."""
    reports = {kind_name(flow.message) for flow in plan.reports}
    return lambda kind: SYNC if kind in SYNCHRONISING else REPORTS if kind in reports else CONTROL


# --- what that cost ---------------------------------------------------------------------------------------------------


def _spent(one: Battery, use: _Use, heard: Overheard) -> Node:
    """What a process spent."""
    node: Node = {period: dict.fromkeys(PURPOSES, 0.0) for period in PERIODS}
    for medium, activity in one.activities.items():
        _add(node, one.spec.id, medium, activity, one.powers[medium], use, heard)
    return node


def _add(node: Node, id: str, medium: str, activity: Activity, power: Power, use: _Use, heard: Overheard) -> None:
    """Add what one of its radios spent."""
    key = id, medium
    sent, received, lived = use.sent[key], use.received[key], use.lived[id]
    busy: defaultdict[str, float] = defaultdict(float)
    anyhow = {(period, CONTROL): ns for period, ns in lived.items()}
    for total_ns, rate, shares in (
        (activity.send_ns, power.send_uw, (sent, received, anyhow)),
        (activity.receive_ns, power.receive_uw, (received, sent, anyhow)),
    ):
        for (period, purpose), ns in divided(total_ns, *shares).items():
            busy[period] += ns
            node[period][purpose] += rate * ns * _FJ
    listened = divided(activity.listen_ns, use.open.get(key, {}), lived)
    for period, ns in listened.items():
        over_ns = min(heard.get((id, medium, period), 0), ns)
        node[period]["overhear"] += power.listen_uw * over_ns * _FJ
        node[period]["listen"] += power.listen_uw * (ns - over_ns) * _FJ
    rest = {period: max(ns - busy[period] - listened.get(period, 0.0), 0.0) for period, ns in lived.items()}
    for period, ns in divided(activity.sleep_ns, rest, lived).items():
        node[period]["sleep"] += power.sleep_uw * ns * _FJ
    reported: defaultdict[str, float] = defaultdict(float)
    for (period, purpose), size in sent.items():
        reported[period] += size if purpose == REPORTS else 0.0
    for period, number in divided(activity.samples, reported, {PRESENT: lived[PRESENT]}, lived).items():
        node[period]["sense"] += power.sample_fj * number * _FJ


def divided(total: float, *shares: Mapping[Any, float]) -> dict[Any, float]:
    """The total, divided in proportion to the first of the ``shares`` that has any above 0; empty if there is none."""
    for one in shares:
        whole = sum(one.values())
        if total and whole > 0:
            return {name: total * share / whole for name, share in one.items()}
    return {}


def _period(period: str, lasted_s: float, use: _Use, nodes: Iterable[Node]) -> dict[str, Any]:
    """What was sent and spent in a period."""
    nodes = list(nodes)
    by = {purpose: sum(node[period][purpose] for node in nodes) if nodes else None for purpose in PURPOSES}
    total = sum(value for value in by.values() if value is not None) if nodes else None
    return {"s": lasted_s, "bytes": use.bytes[period], "total_j": total, "by": by}


def _power(period: Mapping[str, Any]) -> float | None:
    """The mean power (W) of all batteries together in a period; None if there was no such period."""
    return period["total_j"] / period["s"] if period["s"] and period["total_j"] is not None else None


def _hottest(spent: Sequence[float]) -> float | None:
    """What the process that spent most spent, divided by the mean."""
    return max(spent) * len(spent) / sum(spent) if sum(spent) > 0 else None


def _lifetime(one: Battery, node: Node, lasted: Mapping[str, float]) -> float | None:
    """How long (s) a battery lasts with a target for ``SHARE_PRESENT`` of the time; None if that is not known."""
    capacity = one.power.battery_fj
    if capacity is None or not lasted[PRESENT] or not lasted[IDLE]:
        return None
    present, idle = (sum(node[period].values()) / lasted[period] for period in (PRESENT, IDLE))
    power_w = SHARE_PRESENT * present + (1 - SHARE_PRESENT) * idle
    return max(capacity * _FJ - sum(node[SETUP].values()), 0.0) / power_w if power_w > 0 else None


def _lifetimes(ends: Sequence[float | None]) -> dict[str, float | None]:
    """Until the first battery is empty, and until half of them are."""
    order = sorted(end for end in ends if end is not None)
    if not order:
        return {"first_death": None, "half_dead": None}
    return {"first_death": order[0], "half_dead": order[ceil(len(order) / 2) - 1]}
