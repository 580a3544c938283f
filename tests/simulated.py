"""Runs in virtual time that leave no files behind."""

from __future__ import annotations

from collections.abc import Sequence

from launcher.ledger import Ledger
from launcher.prepare import load, planned
from launcher.records import Plan
from launcher.tables import TrackRow, track_rows
from trackfield.drivers.virtual import Virtual


def simulated(plan: Plan) -> tuple[Ledger, list[TrackRow]]:
    """The closed ledger and the tracks of a run."""
    ledger = Ledger(plan.run, plan.processes)
    virtual = Virtual(plan.run, plan.processes, ledger)
    virtual.run()
    ledger.close()
    return ledger, track_rows([(t, p.estimate) for t, _, p in ledger.estimates()], plan.path, plan.step_ns)


def spcpf(seed: int = 1, settings: Sequence[str] = ()) -> Plan:
    """The plan of the packaged scenario ``spcpf`` with some settings."""
    return planned(load("spcpf", seed=seed, settings=settings))
