"""What must hold of a run, whatever befell it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from math import isfinite
from typing import Final

from fusion.role import Phase as CentrePhase
from launcher.record.figures.hops import REPORTS
from launcher.record.ledger import Ledger
from launcher.record.metrics import Metrics, run_metrics
from launcher.record.tables import TrackRow, track_rows
from launcher.records import Plan
from node.role import Phase as NodePhase
from tests.protocols.agreement import Compared, compared
from tests.running import SPEEDS, kept_up
from trackfield.drivers.engine.frames import Charge, Died, Queued
from trackfield.drivers.spec import life_name
from trackfield.drivers.virtual import Virtual
from trackfield.errors import RunFailed
from trackfield.role import NS, State

MAX_EVENTS: Final = 1_000_000
"""A run of this size has a hundred times fewer."""
STATES: Final = {phase.value for phases in (NodePhase, CentrePhase) for phase in phases if phase.value != "new"}


@dataclass(frozen=True)
class Run:
    """A finished run in virtual time."""

    plan: Plan
    ledger: Ledger
    tracks: list[TrackRow]
    metrics: Metrics
    ended: bool


def run(plan: Plan) -> Run:
    events = 0

    def stop() -> bool:
        nonlocal events
        events += 1
        return events > MAX_EVENTS

    ledger = Ledger(plan.run, plan.processes)
    Virtual(plan.run, plan.processes, ledger).run(stop)
    ledger.close()
    tracks = track_rows(ledger.estimates(), plan.paths)
    return Run(plan, ledger, tracks, run_metrics(plan, ledger, tracks), events <= MAX_EVENTS)


def complaints(run: Run) -> Iterator[str]:
    """All that does not hold of a run."""
    if not run.ended:
        yield f"does not end: {MAX_EVENTS} events and no end in sight"
    yield from _accounts(run)
    yield from _lives(run)
    yield from _reports(run)
    for row in run.tracks:
        if not all(map(isfinite, (*row.point.mean, *row.point.covariance))):
            yield f"{row.point.tracker} at step {row.point.step} is no number: {row.point.mean}"


def _accounts(run: Run) -> Iterator[str]:
    """Each frame has one outcome, and the processes counted the same."""
    frames, ledger = run.metrics["frames"], run.ledger
    lost = sum(frames["lost"].values())
    if frames["expected"] != frames["delivered"] + lost + frames["host_lost"]:
        yield f"the ledger does not close: {frames}"
    if frames["host_lost"] or ledger.dropped():
        yield f"{frames['host_lost']} frames lost by the machine, {ledger.dropped()} unseen by the recorder"
    outcomes = Counter("delivered" if row.delivered else row.outcome for row in ledger.rows)
    for outcome in ("delivered", "asleep", "frozen"):
        counted = sum(record.get(outcome, 0) for record in ledger.finals.values())
        if counted != outcomes[outcome]:
            yield f"processes counted {counted} frames {outcome}, the ledger {outcomes[outcome]}"


def _lives(run: Run) -> Iterator[str]:
    """Nobody tells or sends anything while it is dead or frozen, and all states are known ones.

    A radio sends what waits for it by itself, when its process is frozen or its battery empty meanwhile.
    """
    sent: dict[str, set[int]] = {}
    for row in run.ledger.rows:
        sent.setdefault(life_name(row.src, row.incarnation), set()).add(row.sent_ns)
    for name, diary in run.ledger.diaries.items():
        told = [o for o in diary.told if not isinstance(o.effect, Charge | Died)]
        left = sent.get(name, set())
        at_once = left - {o.effect.sent_ns for o in told if isinstance(o.effect, Queued)}
        acts = sorted({o.key[0] for o in told} | {key[0] for key, _ in diary.radio} | at_once)
        for t_ns in sorted(left.union(acts)):
            if not diary.owns(t_ns):
                yield f"{name} acts at {t_ns / NS:.6f} s, outside of its life"
        for t_ns in acts:
            if any(begin <= t_ns < until for begin, until in diary.spec.freezes):
                yield f"{name} acts at {t_ns / NS:.6f} s, while it is frozen"
            if diary.died is not None and t_ns > diary.died[0]:
                yield f"{name} acts at {t_ns / NS:.6f} s, after its battery was empty"
        for o in told:
            if isinstance(o.effect, State) and o.effect.name not in STATES:
                yield f"{name} is in an unknown state {o.effect.name!r}"


def _reports(run: Run) -> Iterator[str]:
    """No life of a node reports a step twice."""
    frames = {(r.src, r.incarnation, r.step, r.sent_ns, r.copy) for r in run.ledger.rows if r.kind in REPORTS}
    times = Counter(frame[:3] for frame in frames)
    for (src, incarnation, step), count in times.items():
        if count > 1:
            yield f"{src} reports step {step} {count} times in its life {incarnation}"


def disagreements(plan: Plan) -> tuple[list[str], Compared | None]:
    """What tells a run as processes from one in virtual time, at the highest speed that the machine keeps up with.

    And that run, unless its processes did not even start.
    """
    for speed in SPEEDS:
        try:
            (real,) = compared(plan, speed)
        except RunFailed as error:
            return [f"as processes: {error}\n{error.log}"], None
        if kept_up(real.metrics):
            return [f"as processes: {what}" for what in real.found], real
    return [f"the machine is too slow for speed {SPEEDS[-1]:g}", *real.found], real
