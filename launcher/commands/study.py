"""``study``."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from launcher.commands import choices
from launcher.commands.arguments import Dask
from launcher.commands.request import Changed, command


@dataclass(frozen=True)
class Asked(Changed):
    """A changed scenario, and which runs of it a study is to make."""

    seeds: Annotated[
        str, typer.Option(metavar="N", help="The seeds of each combination: N for 1 to N, or A-B, or A,B,C.")
    ] = "10"
    vary: Annotated[
        list[str] | None,
        typer.Option(
            "--vary",
            metavar="KEY=A,B,C",
            autocompletion=choices.completed(choices.settings),
            help="Vary a key over values, like field.spacing_m=50,75 or tracker=ukf,ekf; repeated: all combinations.",
        ),
    ] = None
    pareto: Annotated[
        str | None,
        typer.Option(metavar="X,Y", help="The two figures of the Pareto front, by their keys; unset: energy and RMSE."),
    ] = None
    jobs: Annotated[int | None, typer.Option(min=1, help="The number of runs at a time; unset: one per core.")] = None
    dask: Dask = None
    out: Annotated[
        Path | None, typer.Option(help="The folder of the study; runs that it already has are not repeated.")
    ] = None


@command(Asked)
def study(asked: Asked) -> None:
    """Run a scenario with many seeds, and for several values of a key if asked: a table, pictures, a page."""
    from launcher.plan.prepare import changes
    from launcher.study.command import conduct
    from launcher.study.parallel import computed
    from trackfield.errors import ScenarioError
    from trackfield.filters.trackers import TRACKERS
    from trackfield.scenario import Scenario

    fixed = changes(asked.scenario, **asked.options)
    scenario = Scenario.load(asked.scenario, fixed, known_trackers=TRACKERS)
    if asked.dask and asked.jobs:
        raise ScenarioError("has no effect beside --dask", key="--jobs", expected="one of the two")
    with computed(asked.dask):
        conduct(
            scenario,
            seeds=asked.seeds,
            vary=asked.vary or (),
            fixed=fixed,
            pareto=asked.pareto,
            n_jobs=asked.jobs or -1,
            out=asked.out,
            command=sys.argv,
        )
