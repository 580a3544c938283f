"""Where the camera has to look for a target, and for how long.

A target that is beyond the reach of pan and tilt may be in the picture all the same, up to half its width further: if
the camera cannot look straight at it, it looks as far as it can, at the first instant at which that is enough.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from camera.fixes import Target
from camera.settings import USEFUL_S, Settings
from trackfield.models.pointing import Aim, Direction, in_view, intercept, limited, slew_s, towards
from trackfield.role import NS

FINE_S: Final = 0.02
"""The beginning and the end of a view are found to this."""


class Camera(NamedTuple):
    """Where it looks when it begins to turn, ``lead_s`` after it is told."""

    look: Direction
    lead_s: float


def aim_at(target: Target, camera: Camera, now_ns: int, settings: Settings) -> Aim | None:
    """The aim if the camera is told at ``now_ns`` (time of the run); None if there is none, or the fix is too old."""
    if target.age_s(now_ns) > USEFUL_S:
        return None
    if not settings.predict:
        return _at(target.at(target.cpa_ns), camera, settings)
    age_s = target.age_s(now_ns)
    straight = intercept(settings.mount, camera.look, target.state, age_s, camera.lead_s, USEFUL_S)
    return straight or _from_the_edge(target, camera, now_ns, settings)


def _at(place: tuple[float, float], camera: Camera, settings: Settings) -> Aim | None:
    """The aim at something that stands there (m)."""
    to = limited(towards(settings.mount, *place))
    if not in_view(settings.mount, to, *place):
        return None
    return Aim(camera.lead_s + slew_s(camera.look, to), *place, to)


def _from_the_edge(target: Target, camera: Camera, now_ns: int, settings: Settings) -> Aim | None:
    """The first aim by which the target is in the picture, though the camera cannot look straight at it."""
    for step in range(round(USEFUL_S / FINE_S)):
        after_s = camera.lead_s + step * FINE_S
        aim = _at(target.at(now_ns + round(after_s * NS)), camera, settings)
        if aim is not None and aim.after_s <= after_s:
            return aim._replace(after_s=after_s)
    return None


def film_s(target: Target, aim: Aim, turned_s: float, now_ns: int, settings: Settings) -> tuple[float, float]:
    """How long the shot lasts, and until when the camera is for this target, both from now on.

    A shot is longer by how long the camera waits there, which has turned after ``turned_s``. The camera is for the
    target until that has left the picture, or the shot is over.
    """
    lasts_s = settings.shot_s + max(aim.after_s - turned_s, 0.0)
    after_s = aim.after_s
    while after_s < lasts_s and in_view(settings.mount, aim.to, *target.at(now_ns + round(after_s * NS))):
        after_s += FINE_S
    return lasts_s, min(after_s, max(lasts_s, aim.after_s))
