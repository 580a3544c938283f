"""``run``."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from launcher.commands.arguments import End, LinkModel, Name, Nodes, Sensors, Set, Start, Target, Trackers


def run(
    scenario: Name,
    seed: Annotated[
        int | None, typer.Option(help="Decides every random draw; the scenario's own if not given.")
    ] = None,
    speed: Annotated[float, typer.Option(help="Emulated seconds per second.")] = 1.0,
    virtual: Annotated[bool, typer.Option("--virtual", help="In virtual time, in one process.")] = False,
    overrides: Set = None,
    target: Target = None,
    start: Start = None,
    end: End = None,
    sensors: Sensors = None,
    nodes: Nodes = None,
    link: LinkModel = None,
    tracker: Trackers = None,
    out: Annotated[Path | None, typer.Option(help="The run folder; new or empty.")] = None,
    live: Annotated[bool, typer.Option("--live", help="Show the run in the browser while it goes on.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print metrics.json, and nothing else, to stdout.")] = False,
    connect: Annotated[str, typer.Option(help="Use the Zenoh router at this endpoint.")] = "",
    external: Annotated[
        bool, typer.Option("--external", help="Wait for processes that start elsewhere and join through --connect.")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress.")] = False,
) -> None:
    """Run a scenario and leave a run folder with its timeline, tables and metrics."""
    from launcher.drawing import written_beside
    from launcher.options import check_driver, check_endpoint
    from launcher.plan.prepare import load, planned
    from launcher.record.folder import keep, prepare_folder
    from launcher.show import announce, conclude, observing, tell

    resolved = load(
        scenario,
        settings=overrides or (),
        seed=seed,
        target=target,
        start=start,
        end=end,
        sensors=sensors,
        nodes=nodes,
        link=link,
        trackers=tracker or (),
    )
    plan = planned(resolved, speed)
    if connect:
        check_endpoint(connect, "--connect")
    check_driver(virtual=virtual, external=external, live=live, connect=connect)
    folder = prepare_folder(out, resolved.name, resolved.seed)
    keep(resolved, folder)
    if not quiet:
        announce(plan)
    if virtual:
        with written_beside() as write:
            from launcher.run import run_virtual  # loads Rerun, while the report's process loads matplotlib

            outcome = run_virtual(plan, folder, sys.argv, write=write)
    else:
        from launcher.run import run_processes

        with observing(plan, quiet=quiet) as observer:
            live_to = tell if live else None
            outcome = run_processes(plan, folder, observer, sys.argv, connect, external=external, live=live_to)
    if as_json:
        print(json.dumps(outcome.metrics, indent=2))
    if not quiet or outcome.complaints or outcome.unreported:
        conclude(outcome)
    raise typer.Exit(outcome.exit_code)
