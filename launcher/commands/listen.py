"""``listen``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from launcher.commands import choices

if TYPE_CHECKING:
    from launcher.listening.passes import Listened
    from trackfield.acoustics.listener import Detection


def listen(
    file: Annotated[Path, typer.Argument(metavar="FILE.wav", help="A recording, of any rate, depth and channels.")],
    detector: Annotated[
        str,
        typer.Option(
            autocompletion=choices.completed(choices.detectors), help="How the time of a pass is found: {detectors}."
        ),
    ] = "fit",
    png: Annotated[Path | None, typer.Option(help="Write a picture of the recording and its passes.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print what was found as JSON.")] = False,
) -> None:
    """Listen to a recording as a sensor would, and tell which vehicles pass in it, when and how near."""
    from launcher.files import check_writable
    from launcher.listening.passes import listen as heard
    from launcher.show import tell
    from trackfield.acoustics.listener import DETECTORS
    from trackfield.errors import ScenarioError
    from trackfield.scenario.nearest import suggestion

    if detector not in DETECTORS:
        what = f"unknown detector {detector!r}{suggestion(detector, DETECTORS)}"
        raise ScenarioError(what, key="--detector", expected=f"one of {', '.join(DETECTORS)}")
    if png is not None:
        check_writable(png, "--png")
        if png.suffix.lower() != ".png":
            raise ScenarioError("is no PNG file", file=str(png), key="--png", expected="a name that ends in .png")
    listened = heard(file, detector, "FILE.wav")
    if png is not None:
        from launcher.listening.picture import draw  # matplotlib takes a while to load

        draw(listened, file.name, png)
        tell(f"wrote {png}")
    if as_json:
        passes = [_plain(one) for one, _ in listened.passes]
        print(json.dumps({"seconds": round(listened.seconds, 3), "passes": passes}, indent=2))
    else:
        _say(listened)


def _plain(one: Detection) -> dict[str, Any]:
    """Its numbers by name, to what they are worth."""
    return {name: round(value, 4) for name, value in one._asdict().items()}


def _say(listened: Listened) -> None:
    """A line for each pass."""
    if not listened.passes:
        print(f"no pass in {listened.seconds:.1f} s")
    for one, _ in listened.passes:
        print(
            f"pass at {one.peak_s:.2f} s (sd {one.time_sd_s:.2f} s): strength {one.strength_db:.1f} dB, "
            f"width {one.width_s:.2f} s, confidence {one.confidence:.2f}; told at {one.known_s:.2f} s"
        )
