"""Shots and frames of a camera beside the truth: whether the target was in the picture, and why not."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import hypot
from typing import Final, NamedTuple

from launcher.outside import Aim, Exposure, Outside, Target, nearest, target_at
from trackfield.models.pointing import towards
from trackfield.role import NS
from trackfield.world.path import Path

THERE_DEG: Final = 0.2
"""A camera that is told where to look in steps of 0.11 degrees looks there if it is no further off, each way."""

REPLACED: Final = "replaced by the next shot"
AFTER: Final = "after the end of the run"
UNTOLD: Final = "the camera did not tell where it looked"
UNRECORDED: Final = "where targets were is not recorded"
"""Why nobody can say whether a target was in the picture at the aim."""
NOBODY: Final = "no target was there"
STILL: Final = "the camera did not look there"
ELSEWHERE: Final = "the target was elsewhere"
"""Why it was not."""


class Error(NamedTuple):
    """How far off a shot was at its aim: its place (m), and where the camera looked, pan and tilt (deg; right, up)."""

    place_m: float
    pan_deg: float
    tilt_deg: float


@dataclass(frozen=True)
class Shot:
    """A shot beside the truth.

    ``target`` is the one that it is of: the nearest to where it aims, when it aims. ``in_frame`` says whether that was
    in the picture then (None: nobody knows), ``why`` why not, or why nobody knows. ``slew_s`` is how long the turn took
    that led to where the camera was told to look; None if there was none. ``frames`` are those of its video in which
    it can be said whether the target was in them, and whether it was.
    """

    aim: Aim
    target: str | None
    in_frame: bool | None
    why: str
    error: Error | None
    slew_s: float | None
    frames: tuple[tuple[Exposure, bool], ...]

    @property
    def judged(self) -> bool:
        """Whether it can be said if the target was in the picture at the aim."""
        return self.in_frame is not None

    @property
    def first_seen_s(self) -> float | None:
        """From the last CPA of its event to the first frame with the target; None without one."""
        first = next((frame.t_ns for frame, seen in self.frames if seen), None)
        return None if first is None else (first - self.aim.cpa_ns) / NS


@dataclass(frozen=True)
class Judge:
    """What a camera did, beside the ``paths`` of the targets in emulated time, in a run that ended at ``end_ns``."""

    outside: Outside
    paths: Mapping[str, Path]
    end_ns: int

    @cached_property
    def shots(self) -> tuple[Shot, ...]:
        """All shots, in the order of time."""
        return tuple(self._shot(aim) for aim in self.outside.shots)

    @cached_property
    def _frames(self) -> Mapping[Aim, Sequence[Exposure]]:
        """The frames of each shot."""
        found: dict[Aim, list[Exposure]] = defaultdict(list)
        for frame in self.outside.exposures:
            if (shot := self.outside.shot_of(frame)) is not None:
                found[shot].append(frame)
        return found

    def _shot(self, aim: Aim) -> Shot:
        target = self._meant(aim)
        error = self._error(aim, target) if target else None
        in_frame, why = self._seen(aim, target)
        frames = [(one, self._sees(one.t_ns, target)) for one in self._frames.get(aim, ())]
        known = tuple((frame, seen) for frame, seen in frames if seen is not None)
        id = target.id if target else None
        return Shot(aim, id, in_frame, why, error if in_frame is not None else None, self._slew_s(aim), known)

    def _meant(self, aim: Aim) -> Target | None:
        """The target that a shot is of; of one that aims at later than the run, the nearest at its end."""
        return nearest(self.paths, min(aim.aim_ns, self.end_ns), aim.aim_x_m, aim.aim_y_m)

    def _seen(self, aim: Aim, target: Target | None) -> tuple[bool | None, str]:
        """Whether the target was in the picture at the aim (None: nobody knows), and why not."""
        look = self.outside.look_at(aim.aim_ns)
        if why := self._unknown(aim, target):
            return None, why
        if target is None or look is None:
            return False, NOBODY
        if self.outside.sees(aim.aim_ns, target):
            return True, ""
        aside = max(abs(look.pan - aim.pan_deg), abs(look.tilt - aim.tilt_deg))
        return False, ELSEWHERE if aside <= THERE_DEG else STILL

    def _unknown(self, aim: Aim, target: Target | None) -> str:
        """Why nobody can say that; empty if somebody can."""
        after = self.outside.after(aim)
        if after is not None and after.t_ns <= aim.aim_ns:
            return REPLACED
        if aim.aim_ns > self.end_ns:
            return AFTER
        if self.outside.look_at(aim.aim_ns) is None:
            return UNTOLD
        return UNRECORDED if not self.paths or (target and self._guessed(target.id, aim.aim_ns)) else ""

    def _sees(self, t_ns: int, target: Target | None) -> bool | None:
        """Whether the target of a shot is in the picture; None if nobody knows."""
        if not self.paths or t_ns > self.end_ns or (target and self._guessed(target.id, t_ns)):
            return None
        return self.outside.sees(t_ns, target_at(self.paths, target.id, t_ns) if target else None)

    def _guessed(self, id: str, t_ns: int) -> bool:
        """Whether a straight line stands in for where the target was."""
        return self.paths[id].interpolated(t_ns / NS)

    def _error(self, aim: Aim, target: Target) -> Error | None:
        look = self.outside.look_at(aim.aim_ns)
        if look is None:
            return None
        true = towards(self.outside.mount, target.x_m, target.y_m)
        pan = (look.pan - true.pan + 180.0) % 360.0 - 180.0
        return Error(hypot(aim.aim_x_m - target.x_m, aim.aim_y_m - target.y_m), pan, look.tilt - true.tilt)

    def _slew_s(self, aim: Aim) -> float | None:
        """How long the camera turned until it looked where it was told to."""
        after = self.outside.after(aim)
        until_ns = self.end_ns if after is None else after.t_ns
        for turn in self.outside.turns:
            if aim.t_ns <= turn.t_ns <= until_ns:
                aside = max(abs(turn.pan1 - aim.pan_deg), abs(turn.tilt1 - aim.tilt_deg))
                if aside <= THERE_DEG:
                    return turn.motion.lasts_s
        return None
