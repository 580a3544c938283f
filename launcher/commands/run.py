"""``run``."""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING

import typer

from launcher import INTERRUPTED
from launcher.commands.request import Request, command

if TYPE_CHECKING:
    from pathlib import Path

    from launcher.records import Plan
    from launcher.run import Outcome
    from launcher.security.security import Security


@command(Request)
def run(request: Request) -> None:
    """Run a scenario and leave a run folder with its timeline, tables, metrics and report."""
    from launcher.plan.bridges import in_folder, with_terminals
    from launcher.record.folder import keep, prepare_folder, whole_or_none
    from launcher.show import announce, conclude, devices, warn

    folder = None
    try:
        scenario, plan = request.prepared()
        request.check_machine(plan)
        security = request.security(plan)
        folder = prepare_folder(request.out, scenario.name, scenario.seed)
        plan = in_folder(plan, folder)
        if not request.virtual:
            plan = with_terminals(plan, folder)
        with whole_or_none(folder):
            keep(scenario, folder)
            if not request.quiet:
                announce(plan)
                warn(plan.warnings)
                devices(plan, folder)
            outcome = _carried_out(request, plan, security, folder)
    except KeyboardInterrupt:
        done = folder is not None and folder.exists()
        what = f"after the run, which is in {folder}" if done else "before the run began; there is no run folder"
        print(f"trackfield: interrupted {what}", file=sys.stderr)
        raise typer.Exit(INTERRUPTED) from None
    if request.as_json:
        print(json.dumps(outcome.metrics, indent=2))
    if not request.quiet or outcome.complaints or outcome.unreported:
        conclude(outcome)
    raise typer.Exit(outcome.exit_code)


def _carried_out(request: Request, plan: Plan, security: Security | None, folder: Path) -> Outcome:
    """Do the run and show its progress as the terminal allows."""
    from launcher.drawing import written_beside
    from launcher.show import observing, progress, tell

    if request.virtual:
        with written_beside() as write, progress(plan, quiet=request.quiet) as tick:
            from launcher.run import run_virtual  # loads Rerun, while the report's process loads matplotlib

            return run_virtual(plan, folder, sys.argv, tick=tick, write=write)
    from launcher.processes.endpoint import Way
    from launcher.processes.gathering import GATHER_TIMEOUT_S, Guests
    from launcher.run import run_processes

    way = Way(request.connect, tuple(request.listen or ()), security)
    guests = Guests(request.elsewhere(plan), request.wait or GATHER_TIMEOUT_S)
    with observing(plan, quiet=request.quiet) as observer:
        live = tell if request.live or request.live_at else None
        return run_processes(plan, folder, observer, sys.argv, way, guests=guests, live=live, live_at=request.live_at)
