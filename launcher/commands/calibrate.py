"""``calibrate``: a command for each kind of measurement."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from launcher.commands import choices

if TYPE_CHECKING:
    from launcher.calibrate.sensors import SensorFit

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


Sensors = Annotated[
    Path, typer.Option(help="The sensors' places: a CSV file with the columns id,x,y, in metres, or packaged.")
]
Out = Annotated[Path | None, typer.Option(help="The file to write; unset: it is printed.")]
Picture = Annotated[Path | None, typer.Option(help="A PNG file for what the fit leaves of each report.")]
_REPORTS: Final = "CSV or Parquet, with the columns t_s,sensor,x_m,y_m and one of numbers; or packaged."


@kind("rss")
def rss(
    files: Annotated[list[Path], typer.Argument(metavar="FILES...", help=f"Recordings of reports: {_REPORTS}")],
    sensors: Sensors,
    out: Out = None,
    picture: Picture = None,
) -> None:
    """Fit level, decay, shadowing, its correlation in time, offsets and missing reports of sensors of kind rss."""
    from launcher.calibrate.rss import calibrate_rss

    _fit(lambda: calibrate_rss(files, sensors), sensors, out, picture)


@kind("energy")
def energy(
    file: Annotated[Path, typer.Argument(metavar="FILE", help=f"A recording of one target's pass: {_REPORTS}")],
    sensors: Sensors,
    out: Out = None,
    picture: Picture = None,
) -> None:
    """Fit what is emitted, decay, both noises, gains and missing reports of sensors of kind energy."""
    from launcher.calibrate.energy import calibrate_energy

    _fit(lambda: calibrate_energy(file, sensors), sensors, out, picture)


def _fit(fitted: Callable[[], SensorFit], sensors: Path, out: Path | None, picture: Path | None) -> None:
    """Print or write the section, and draw what is left."""
    from launcher.files import check_writable, write_whole
    from launcher.show import tell
    from trackfield.errors import ScenarioError

    for file, key in ((out, "--out"), (picture, "--picture")):
        if file is not None:
            check_writable(file, key)
    if picture is not None and picture.suffix.lower() != ".png":
        raise ScenarioError("is no PNG file", file=str(picture), key="--picture", expected="a name that ends in .png")
    fit = fitted()
    text = fit.fragment(sensors).toml()
    if picture is not None:
        from launcher.calibrate.picture import draw  # matplotlib takes a while to load

        draw(fit, picture)
    if out is None:
        print(text, end="")
    else:
        write_whole(out, text)
    for written in filter(None, (out, picture)):
        tell(f"wrote {written}")
