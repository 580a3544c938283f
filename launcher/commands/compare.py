"""``compare``."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from launcher.commands.arguments import Runs
from trackfield.errors import ScenarioError


def compare(
    runs: Runs,
    exact: Annotated[
        float | None,
        typer.Option(
            metavar="TOL",
            min=0.0,
            help="Fail unless tracks are equal to within this, and the fate of every frame is the same.",
        ),
    ] = None,
) -> None:
    """Show runs side by side, or whether they are the same."""
    from rich.console import Console

    from launcher.study.compare import check_runs, differences
    from launcher.study.side_by_side import side_by_side

    if len(runs) < 2:
        raise ScenarioError("there is nothing to compare it with", key="RUN", expected="two run folders or more")
    check_runs(runs)
    Console(markup=False, emoji=False).print(side_by_side(runs))
    if exact is None:
        return
    found = [f"{other}: {what}" for other in runs[1:] for what in differences(runs[0], other, exact)]
    for line in found:
        print(line, file=sys.stderr)
    if found:
        raise typer.Exit(1)
    print(f"equal to within {exact:g}, and the fate of every frame is the same")
