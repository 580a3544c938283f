"""``compare``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from launcher.commands.arguments import Runs

File = Path | None


def compare(
    runs: Runs,
    exact: Annotated[
        float | None,
        typer.Option(
            metavar="TOL",
            min=0.0,
            help="Fail unless the tracks are equal to within TOL and every frame had the same fate.",
        ),
    ] = None,
    html: Annotated[File, typer.Option(metavar="FILE", help="Write a page with figures and tables.")] = None,
    csv: Annotated[File, typer.Option(metavar="FILE", help="Write the figures of each run and tracker.")] = None,
    rrd: Annotated[
        File, typer.Option(metavar="FILE", help="Write tracks and errors as one recording, of the first six runs.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, and nothing else, to stdout.")] = False,
) -> None:
    """Show runs side by side, or check that they are the same.

    --html, --csv and --rrd overwrite a file that exists.
    """
    from launcher.study.comparison.exact import exactness
    from launcher.study.comparison.outputs import Outputs
    from launcher.study.comparison.runs import read_runs

    compared, outputs = read_runs(runs), Outputs(html, csv, rrd)
    outputs.check(compared)
    answer = None if exact is None else exactness(compared, exact)
    if as_json:
        from launcher.study.comparison.data import as_json as json_of

        print(json_of(compared, answer))
    else:
        from launcher.study.side_by_side import show

        show(compared)
    for written in outputs.write(compared, answer):
        print(written, file=sys.stderr)
    if answer is None:
        return
    for difference in answer.differences:
        print(difference, file=sys.stderr)
    if answer.differences:
        raise typer.Exit(1)
    if not as_json:
        print(answer.text)
