"""What camera control is told by the plan of the run."""

from __future__ import annotations

from dataclasses import dataclass

from trackfield.models.pointing import Mount

USEFUL_S = 10.0
"""A path is taken to be straight for so long: an older fix says nothing of where the target is."""


@dataclass(frozen=True, slots=True)
class Settings:
    """The ids of those that it talks to, how its camera stands, and how steps are numbered.

    Step k is at ``origin_ns`` + k ``step_ns``, in the time of the run. The beliefs of ``tracker`` are used. With
    ``predict`` the camera looks where the target will be, else where it was when it passed the last sensor. Video of a
    shot lasts ``shot_s``; a message over the backbone and its answer take up to ``patience_ns``.
    """

    id: str
    gateway: str
    camera: str
    video: str
    mount: Mount
    origin_ns: int
    step_ns: int
    tracker: str
    predict: bool
    shot_s: float
    patience_ns: int
