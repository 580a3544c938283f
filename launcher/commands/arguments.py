"""Arguments and options that several commands take."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Name = Annotated[str, typer.Argument(metavar="SCENARIO", help="A packaged scenario's name, or a TOML file.")]
Set = Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Override a key, as link.loss=0.1.")]
Target = Annotated[Path | None, typer.Option("--target", help="The target's track: a GPX or CSV file.")]
Start = Annotated[str | None, typer.Option("--from", help="Start of the window in the track, in the file's zone.")]
End = Annotated[str | None, typer.Option("--to", help="End of the window.")]
Sensors = Annotated[Path | None, typer.Option("--sensors", help="Where the sensors stand: a CSV file.")]
Nodes = Annotated[int | None, typer.Option(help="About how many sensors, at the scenario's own spacing.")]
LinkModel = Annotated[str | None, typer.Option("--link", help="The link model, with its default parameters.")]
Trackers = Annotated[list[str] | None, typer.Option("--tracker", help="A tracker to run; may be repeated.")]
