"""``calibrate``: a command for each kind of measurement."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from launcher.commands import choices

group = typer.Typer(
    name="calibrate",
    cls=choices.Commands,
    no_args_is_help=True,
    help="Fit a model to measurements, and write a section for a scenario file, with 95 % intervals.",
)
kind = partial(group.command, cls=choices.Choosing)


@kind("link")
def link(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="A recording of delivery ratios in k7 form, or packaged.")
    ],
    places: Annotated[
        Path | None,
        typer.Option(help="The places of its nodes: a CSV file with the columns id,x,y, in metres."),
    ] = None,
    tx_dbm: Annotated[float, typer.Option(min=-60, max=40, help="The power in dBm with which they sent.")] = 0.0,
    out: Annotated[Path | None, typer.Option(help="The file to write; unset: it is printed.")] = None,
) -> None:
    """Fit path loss, shadowing, asymmetry, noise and bursts of the link model lognormal_prr to a recording."""
    from launcher.calibrate.link import calibrate_link
    from launcher.files import check_writable, write_whole
    from launcher.show import tell

    if out is not None:
        check_writable(out, "--out")
    text = calibrate_link(file, places, tx_dbm).toml()
    if out is None:
        print(text, end="")
    else:
        write_whole(out, text)
        tell(f"wrote {out}")
