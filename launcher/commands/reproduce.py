"""``reproduce``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def reproduce(
    paper: Annotated[str, typer.Argument(metavar="PAPER", help="zhai: Zhai et al. 2009, SP-CPF.")],
    runs: Annotated[int, typer.Option(help="Of each case, with seeds from 1 on.")] = 100,
    out: Annotated[
        Path | None, typer.Option(help="The study's folder; what an earlier one left there is not run again.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print results.json, and nothing else, to stdout.")] = False,
) -> None:
    """Do a paper's experiments again, and say which of its claims hold."""
    from launcher.reproduce.command import reproduce

    print(reproduce(paper, runs, out).shown(as_json=as_json), end="")
