"""Files with the places of a field's sensors."""

from __future__ import annotations

import re
from pathlib import Path as FilePath
from typing import Final

import numpy as np

from trackfield.errors import ScenarioError
from trackfield.scenario.section import ID, ID_WORDS
from trackfield.words import quoted
from trackfield.world.rows import PLACES, Column, read_rows
from trackfield.world.tracks import plane
from trackfield.world.windows import Array

Point = tuple[float, float]
"""Metres east and north."""
Place = tuple[str, float, float]
"""(id, metres east, metres north)"""

ROLES: Final = ("node", "fusion")
RESERVED: Final = ("router", "recorder", "live")
"""Ids that other processes of a run have."""


def read_places(file: FilePath, origin: Array | None, centre: str | None) -> tuple[list[Place], Point | None]:
    """The sensors of a CSV file in its order, and the fusion centre's place if the file has it.

    Columns are ``id``, either ``lat``, ``lon`` in degrees or ``x``, ``y`` in metres, and, if the file has it,
    ``role``: ``node`` (also where it is empty) or ``fusion``, for the row whose id is ``centre`` (None: for one row of
    any id). ``origin`` (2,) is the latitude and longitude of (0, 0); None if they are not known. Of a file with both
    kinds of place, those are read that fit the origin. Raises ``ScenarioError`` if the file cannot be used.
    """
    degrees, metres = ("id", "lat", "lon"), ("id", "x", "y")
    formats = (metres, degrees) if origin is None else (degrees, metres)
    try:
        rows = read_rows(file, formats, _COLUMNS, ("role",))
    except OSError as error:
        raise ScenarioError(f"cannot be read ({error.strerror})", file=str(file)) from None
    lines: dict[str, int] = {}
    hint = centre is not None
    centre = next((row["id"] for _, row in rows if row.get("role") == "fusion"), None) if centre is None else centre
    for line, row in rows:
        _check_name(f"{file}:{line}", row["id"], row.get("role", "node"), centre, lines, hint=hint)
        lines[row["id"]] = line
    geodetic = "lat" in rows[0][1]
    if geodetic != (origin is not None):
        has, lacks = ("lat,lon", "x,y") if geodetic else ("x,y", "lat,lon")
        what = f"has the columns {has}, but the target's path is in {'metres' if geodetic else 'lat,lon'}"
        raise ScenarioError(what, file=str(file), expected=f"the columns {lacks}, or a track in {has}")
    points = np.array([[row[name] for name in formats[0][1:]] for _, row in rows])
    places = zip(lines, (points if origin is None else plane(points, origin)).tolist(), strict=True)
    found = {id: (x, y) for id, (x, y) in places}
    place = None if centre is None else found.pop(centre, None)
    if not found:
        raise ScenarioError("no sensors", file=str(file), expected="at least one row with the role node")
    return [(id, *point) for id, point in found.items()], place


def _check_name(where: str, id: str, role: str, centre: str | None, lines: dict[str, int], *, hint: bool) -> None:
    """Raise ``ScenarioError`` unless the id is new and allowed for this role; ``hint``: a scenario can name it."""
    if id in lines:
        raise ScenarioError(
            f"id {quoted(id)} is given twice", file=where, expected=f"an id other than that of line {lines[id]}"
        )
    if id in RESERVED or (id == centre) != (role == "fusion"):
        others = ", ".join(filter(None, (centre, *RESERVED)))
        expected = f"the id {centre}" if role == "fusion" and id != centre else f"an id other than {others}"
        if role == "fusion" and id not in RESERVED and hint:
            expected += f", or architecture.centre = {id!r} in the scenario"
        raise ScenarioError(f"a {role} is called {quoted(id)}", file=where, expected=expected)


def _id(text: str) -> str:
    if not re.fullmatch(ID, text):
        raise ValueError
    return text


def _role(text: str) -> str:
    if text and text not in ROLES:
        raise ValueError
    return text or "node"


_COLUMNS: Final[dict[str, Column]] = {
    **PLACES,
    "id": (_id, ID_WORDS),
    "role": (_role, f"one of {', '.join(ROLES)}"),
}
