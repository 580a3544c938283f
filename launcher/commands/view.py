"""``view`` and ``report``: look at a finished run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

import typer

from launcher.commands.arguments import Run, RunIfAny

PORTS: Final = 1 << 16


def view(
    run: RunIfAny = None,
    web: Annotated[bool, typer.Option("--web", help="Show the timeline in the browser.")] = False,
    bind: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="With --web: the address of this machine to be at; unset: 127.0.0.1."),
    ] = None,
    ports: Annotated[
        tuple[int, int] | None,
        typer.Option(metavar="PAGE DATA", help="With --web: the ports of the page and of its data; unset: free ones."),
    ] = None,
    png: Annotated[Path | None, typer.Option(help="Write a picture of the timeline instead, without a screen.")] = None,
    at: Annotated[
        float | None,
        typer.Option(help="The second of the run that the picture shows; unset: 60 % of its length."),
    ] = None,
) -> None:
    """Open the timeline of a run; with --web and no RUN, what runs with --live-at send."""
    from launcher.timeline.view import LOOPBACK, Served, open_viewer, picture
    from trackfield.errors import ScenarioError

    if run is None and not web:
        raise ScenarioError("is missing", key="RUN", expected="the folder of a finished run, or --web")
    for key, given in (("--bind", bind), ("--ports", ports)):
        if given is not None and not web:
            raise ScenarioError("is for browsers only", key=key, expected="--web as well")
    if ports is not None and not all(0 < port < PORTS for port in ports):
        expected = f"two numbers from 1 to {PORTS - 1}"
        raise ScenarioError(f"is {ports[0]} {ports[1]}", key="--ports", expected=expected)
    if at is not None and png is None:
        raise ScenarioError("is for a picture only", key="--at", expected="--png FILE as well")
    if web and png is not None:
        raise ScenarioError("a picture is not shown in the browser", key="--web, --png", expected="one of them")
    if run is not None and png is not None:
        picture(run, png, at)
    else:
        open_viewer(run, web, Served(bind or LOOPBACK, ports))


def report(run: Run) -> None:
    """Draw the figures of a run and write its report.html again."""
    from launcher.report import write_report

    print(write_report(run))
