"""What a camera saw in a run: its frames for the timeline, and a video in the run folder."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Final

from launcher.filming.frames import Frame
from launcher.outside import VIDEO as CAPTURES
from launcher.outside import Outside
from launcher.records import SENSES, Plan
from trackfield.role import NS

VIDEO: Final = "video.mp4"
SHEET: Final = "plots/camera.png"
VIDEO_FAILED: Final = "the video failed: "


def film_run(plan: Plan, outside: Outside, folder: Path, show: Callable[[Frame], object]) -> int:
    """Draw the frames of a run; ``show`` each, and write them into its folder, if there are any.

    What was aimed at goes into a contact sheet for the report. Returns how many frames are left out, as there are many.
    """
    from launcher.filming.film import Film  # loads Pillow
    from launcher.filming.painter import marked
    from launcher.filming.sheet import sheet
    from launcher.filming.video import jpeg, writing  # loads PyAV

    film = Film(
        outside, plan.paths, {place.id: (place.x, place.y) for place in plan.info.tagged(SENSES)}, plan.origin_ns
    )
    if (whole := sheet(film)) is not None:
        (folder / SHEET).parent.mkdir(exist_ok=True)
        whole.save(folder / SHEET, optimize=True)
    if not film:
        return 0
    with writing(folder / VIDEO, _rate(plan) / film.every) as video:
        for taken in film.taken():
            image = taken.picture.image
            show(Frame(taken.exposed, taken.look, jpeg(image), taken.picture.framed))
            video.add(marked(taken.picture))
    return film.left_out


def _rate(plan: Plan) -> Fraction:
    """How many frames a second were to be exposed."""
    every_ns = next((int(one.config["frame_ns"]) for one in plan.processes if one.role == CAPTURES), NS // 10)
    return Fraction(NS, every_ns).limit_denominator(1000)
