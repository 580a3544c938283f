"""``view`` and ``report``: to look at a finished run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from launcher.commands.arguments import Run


def view(
    run: Run,
    web: Annotated[bool, typer.Option("--web", help="In the browser.")] = False,
    png: Annotated[Path | None, typer.Option(help="Write a picture of the timeline instead, without a screen.")] = None,
    at: Annotated[float | None, typer.Option(help="The emulated second that the picture shows.")] = None,
) -> None:
    """Open a run's timeline."""
    from launcher.timeline.view import open_viewer, picture

    if png is None:
        open_viewer(run, web)
    else:
        picture(run, png, at)


def report(run: Run) -> None:
    """Draw the figures of a run and write its report.html again."""
    from launcher.report import write_report

    print(write_report(run))
