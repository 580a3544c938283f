"""Runs in virtual time that leave no files behind."""

from __future__ import annotations

from launcher.record.ledger import Ledger
from launcher.record.tables import TrackRow, track_rows
from launcher.records import Plan
from trackfield.drivers.virtual import Virtual


def simulate(plan: Plan) -> tuple[Ledger, list[TrackRow]]:
    """The closed ledger and the tracks of a run: what ``trackfield run --virtual`` makes its tables from."""
    ledger = Ledger(plan.run, plan.processes)
    Virtual(plan.run, plan.processes, ledger).run()
    ledger.close()
    return ledger, track_rows(ledger.estimates(), plan.paths)
