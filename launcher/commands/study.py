"""``study``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from launcher.commands import choices
from launcher.commands.arguments import End, LinkModel, Name, Nodes, Sensors, Set, Start, Target, Trackers


def study(
    scenario: Name,
    seeds: Annotated[
        str, typer.Option(metavar="N", help="The seeds of each combination: N for 1 to N, or A-B, or A,B,C.")
    ] = "10",
    vary: Annotated[
        list[str] | None,
        typer.Option(
            "--vary",
            metavar="KEY=A,B,C",
            autocompletion=choices.completed(choices.settings),
            help="Vary a key over values, like field.spacing_m=50,75 or tracker=ukf,ekf; repeated: all combinations.",
        ),
    ] = None,
    pareto: Annotated[
        str | None,
        typer.Option(metavar="X,Y", help="The two figures of the Pareto front, by their keys; unset: energy and RMSE."),
    ] = None,
    jobs: Annotated[int | None, typer.Option(min=1, help="The number of runs at a time; unset: one per core.")] = None,
    overrides: Set = None,
    target: Target = None,
    start: Start = None,
    end: End = None,
    sensors: Sensors = None,
    nodes: Nodes = None,
    link: LinkModel = None,
    tracker: Trackers = None,
    out: Annotated[
        Path | None, typer.Option(help="The folder of the study; runs that it already has are not repeated.")
    ] = None,
) -> None:
    """Run a scenario with many seeds, and for several values of a key if asked: a table, pictures, a page."""
    from launcher.plan.prepare import changes
    from launcher.study.command import conduct
    from trackfield.filters.trackers import TRACKERS
    from trackfield.scenario import Scenario

    fixed = changes(
        scenario,
        settings=overrides or (),
        target=target,
        start=start,
        end=end,
        sensors=sensors,
        nodes=nodes,
        link=link,
        trackers=tracker or (),
    )
    conduct(
        Scenario.load(scenario, fixed, known_trackers=TRACKERS),
        seeds=seeds,
        vary=vary or (),
        fixed=fixed,
        pareto=pareto,
        n_jobs=jobs or -1,
        out=out,
        command=sys.argv,
    )
