"""A contact sheet: what a camera saw of each shot at the instant for which it was aimed."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from PIL import Image, ImageDraw

from launcher.filming.film import Film, Shot
from launcher.filming.painter import INSIDE, OUTSIDE, WORDS, font, marked
from launcher.outside import meant
from trackfield.role import NS

MOST: Final = 12
"""Of more shots the first ones are shown."""
ACROSS: Final = 3
TILE: Final = (400, 300)
GAP: Final = 6
_STRIP: Final = 22
_GROUND: Final = (255, 255, 255)
_DARK: Final = (18, 20, 26)


def sheet(film: Film) -> Image.Image | None:
    """The first shots side by side, each with the targets in boxes; None without a shot."""
    film = replace(film, optics=replace(film.optics, width=TILE[0], height=TILE[1]))
    shots = list(film.shots(MOST))
    if not shots:
        return None
    across = min(len(shots), ACROSS)
    down = -(-len(shots) // across)
    whole = Image.new("RGB", (across * (TILE[0] + GAP) - GAP, down * (TILE[1] + GAP) - GAP), _GROUND)
    for number, shot in enumerate(shots):
        place = number % across * (TILE[0] + GAP), number // across * (TILE[1] + GAP)
        whole.paste(_tile(film, shot), place)
    left = len(film.outside.shots) - len(shots)
    return whole if left <= 0 else _with_note(whole, f"{left} more are not shown")


def seen(film: Film, shot: Shot) -> bool:
    """Whether the middle of the target that a shot is of is in its frame."""
    target = meant(film.paths, shot.aim)
    return any(one.target == target and one.inside for one in shot.picture.framed)


def _tile(film: Film, shot: Shot) -> Image.Image:
    """A shot with its number, its time and whether the target is in the frame, in words below."""
    tile = marked(shot.picture)
    draw, (width, height) = ImageDraw.Draw(tile), TILE
    at_s = (shot.aim.aim_ns - film.origin_ns) / NS
    draw.rectangle((0, height - _STRIP, width, height), _DARK)
    words = f"shot {shot.aim.shot}   {at_s:+.1f} s   pan {shot.look.pan:+.0f}°"
    draw.text((6, height - _STRIP / 2), words, WORDS, font(12), anchor="lm")
    if film.paths:  # otherwise nobody knows
        said, colour = ("in frame", INSIDE) if seen(film, shot) else ("not in frame", OUTSIDE)
        draw.text((width - 6, height - _STRIP / 2), said, colour, font(12), anchor="rm")
    return tile


def _with_note(whole: Image.Image, words: str) -> Image.Image:
    noted = Image.new("RGB", (whole.width, whole.height + _STRIP), _GROUND)
    noted.paste(whole)
    ImageDraw.Draw(noted).text((4, whole.height + _STRIP / 2), words, _DARK, font(11), anchor="lm")
    return noted
