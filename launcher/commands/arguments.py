"""Arguments and options that several commands take."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from launcher.commands import choices


def _run_folder(text: str) -> Path:
    """What ``RUN`` means: a folder, or the latest run, or one of those before it."""
    from launcher.record.latest import run_folder

    return run_folder(text)


def _folders(metavar: str, what: str) -> Any:
    return typer.Argument(
        metavar=metavar,
        parser=_run_folder,
        autocompletion=choices.completed(choices.runs),
        help=f"{what}; latest: the newest below runs/, latest~1: the one before it.",
    )


Run = Annotated[Path, _folders("RUN", "The folder of a finished run")]
RunIfAny = Annotated[Path | None, _folders("[RUN]", "The folder of a finished run")]
Unfinished = Annotated[Path, _folders("RUN", "The folder of a run that was cut off")]
Runs = Annotated[list[Path], _folders("RUN RUN...", "Two or more folders of finished runs")]
Name = Annotated[
    str,
    typer.Argument(
        metavar="SCENARIO",
        autocompletion=choices.completed(choices.scenarios),
        help="A packaged scenario ({scenarios}), or a TOML file.",
    ),
]
Set = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        autocompletion=choices.completed(choices.settings),
        help="Set a key of the scenario, like link.loss=0.1; may be repeated.",
    ),
]
CertificateAuthority = Annotated[
    Path | None,
    typer.Option(
        "--ca",
        metavar="DIR",
        help="An authority of your own, authority.pem and authority.key: it certifies that of the run.",
    ),
]
Target = Annotated[Path | None, typer.Option("--target", help="The target's track: a GPX or CSV file.")]
Start = Annotated[
    str | None,
    typer.Option("--from", metavar="TIME", help="Start of the window in the track, in the time zone of its file."),
]
End = Annotated[str | None, typer.Option("--to", metavar="TIME", help="End of the window in the track.")]
Sensors = Annotated[Path | None, typer.Option("--sensors", help="The positions of the sensors: a CSV file.")]
Nodes = Annotated[
    int | None, typer.Option(help="The number of sensors, approximately, at the spacing of the scenario.")
]
LinkModel = Annotated[
    str | None,
    typer.Option(
        "--link",
        metavar="MODEL",
        autocompletion=choices.completed(choices.links),
        help="The link model, with its default parameters: {links}.",
    ),
]
Trackers = Annotated[
    list[str] | None,
    typer.Option(
        "--tracker",
        metavar="TRACKER",
        autocompletion=choices.completed(choices.trackers),
        help="A tracker to run: {trackers}; may be repeated.",
    ),
]
Dask = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="Compute on the workers of the Dask scheduler at this address, like tcp://127.0.0.1:8786.",
    ),
]
Speed = Annotated[
    float | None, typer.Option(help="Emulated seconds per second of real time, for a run over processes.")
]
