"""``reproduce``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from launcher.commands import choices
from launcher.commands.arguments import Dask


def reproduce(
    paper: Annotated[
        str,
        typer.Argument(
            metavar="PAPER",
            autocompletion=choices.completed(choices.papers),
            help="The paper, as docs/papers.md names it: {papers}.",
        ),
    ],
    runs: Annotated[int, typer.Option(help="The number of runs of each case, with the seeds 1, 2, ...")] = 100,
    out: Annotated[
        Path | None,
        typer.Option(help="The folder of the study; runs that it already has are not repeated, but for --kernels."),
    ] = None,
    kernels: Annotated[
        bool, typer.Option("--kernels", help="The bare filters instead: many runs at once, without roles and messages.")
    ] = False,
    dask: Dask = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print results.json, and nothing else, to stdout.")] = False,
) -> None:
    """Repeat the experiments of a paper and say which of its claims hold."""
    from launcher.reproduce.command import reproduce
    from launcher.reproduce.kernels.command import reproduce_kernels
    from launcher.reproduce.papers import holds_roles
    from launcher.study.parallel import computed

    bare = kernels or holds_roles(paper)
    with computed(dask):
        done = reproduce_kernels(paper, runs, out, roles=not kernels) if bare else reproduce(paper, runs, out)
    print(done.shown(as_json=as_json), end="")
