"""``view`` and ``report``: look at a finished run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from launcher.commands.arguments import Run


def view(
    run: Run,
    web: Annotated[bool, typer.Option("--web", help="Show the timeline in the browser.")] = False,
    png: Annotated[Path | None, typer.Option(help="Write a picture of the timeline instead, without a screen.")] = None,
    at: Annotated[
        float | None,
        typer.Option(help="The second of the run that the picture shows; unset: 60 % of its length."),
    ] = None,
) -> None:
    """Open the timeline of a run."""
    from launcher.timeline.view import open_viewer, picture
    from trackfield.errors import ScenarioError

    if at is not None and png is None:
        raise ScenarioError("is for a picture only", key="--at", expected="--png FILE as well")
    if web and png is not None:
        raise ScenarioError("a picture is not shown in the browser", key="--web, --png", expected="one of them")
    if png is None:
        open_viewer(run, web)
    else:
        picture(run, png, at)


def report(run: Run) -> None:
    """Draw the figures of a run and write its report.html again."""
    from launcher.report import write_report

    print(write_report(run))
