"""Places beyond the gateway of a field: what carries fixes to a camera, and the camera."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Final

from launcher.outside import CAMERA, CONTROL, FORWARDER, GATEWAY, SYSTEM, VIDEO
from launcher.records import FieldInfo, Place

ROLES: Final = (FORWARDER, CONTROL, CAMERA, VIDEO, SYSTEM)
"""The roles of such places."""
AT_CAMERA: Final = (CONTROL, VIDEO, SYSTEM)
"""Those that stand where the camera is, and have no mark of their own there."""
WATCHED: Final = (CONTROL, CAMERA)
"""Those whose states are shown before others."""
SAME_M: Final = 0.5
"""Places that are no further apart have one mark."""


def camera_of(info: FieldInfo) -> Place | None:
    """The camera of a field, if it has one."""
    return next((place for place in info.places if place.role == CAMERA), None)


def beyond(places: Sequence[Place]) -> list[Place]:
    """Those of some places that are beyond the gateway, in the order in which they have been arranged."""
    return [place for place in places if place.role in ROLES]


def within(places: Sequence[Place]) -> list[Place]:
    """The others."""
    return [place for place in places if place.role not in ROLES]


def chain(info: FieldInfo) -> list[Place]:
    """Those by whom a fix goes from the gateway to camera control, in this order."""
    found = {role: [place for place in info.places if place.role == role] for role in (GATEWAY, FORWARDER, CONTROL)}
    return [place for several in found.values() for place in several]


def links(info: FieldInfo) -> list[tuple[str, str]]:
    """The links (from, to) of that way."""
    return [(a.id, b.id) for a, b in pairwise(chain(info))]


def marks(places: Sequence[Place]) -> list[tuple[str, tuple[float, float]]]:
    """The names of places and where these stand; those at one spot have one mark with all their names."""
    spots: list[tuple[list[str], tuple[float, float]]] = []
    shown = [place for place in places if place.role not in AT_CAMERA]
    for place in shown:
        for names, (x, y) in spots:
            if abs(place.x - x) <= SAME_M and abs(place.y - y) <= SAME_M:
                names.append(place.id)
                break
        else:
            spots.append(([place.id], (place.x, place.y)))
    return [(" + ".join(names), at) for names, at in spots]
