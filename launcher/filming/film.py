"""What a camera saw in the course of a run: frames when they were exposed, and one of each shot when it was aimed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from math import ceil
from typing import Final, NamedTuple

import numpy as np

from launcher.filming.lens import Array, Lens
from launcher.filming.painter import NEARER_M, Picture, paint
from launcher.filming.scenery import Scenery
from launcher.filming.vehicle import Vehicle
from launcher.outside import Aim, Exposure, Outside
from trackfield.models.pointing import EVI_D30, Direction, Optics
from trackfield.role import NS
from trackfield.world.path import Path

MOST: Final = 600
"""Of more frames every second, third, ... is drawn."""
TRAIL_S: Final = 6.0
"""So much of where a target has been is drawn on the ground."""
_TRAIL_STEPS: Final = 24


class Taken(NamedTuple):
    """A frame that was exposed, where the camera looked, and what it looks like."""

    exposed: Exposure
    look: Direction
    picture: Picture


class Shot(NamedTuple):
    """What the camera saw at the instant for which it was aimed."""

    aim: Aim
    look: Direction
    picture: Picture


@dataclass(frozen=True)
class Film:
    """Draws what a camera saw.

    ``paths`` are those of the targets, in s since the start of the run, ``sensors`` where sensors stand (m); times in
    frames count from the first step, which is at ``origin_ns``.
    """

    outside: Outside
    paths: Mapping[str, Path]
    sensors: Mapping[str, tuple[float, float]]
    origin_ns: int = 0
    optics: Optics = EVI_D30

    def __bool__(self) -> bool:
        """Whether there is a frame."""
        return bool(self._exposed)

    @property
    def every(self) -> int:
        """Every so many frames one is drawn."""
        return max(ceil(len(self._exposed) / MOST), 1)

    @property
    def left_out(self) -> int:
        """How many frames are not drawn."""
        return len(self._exposed) - ceil(len(self._exposed) / self.every)

    def taken(self) -> Iterator[Taken]:
        """The frames, in the order of time."""
        for exposed, look in self._exposed[:: self.every]:
            said = f"shot {exposed.shot}, frame {exposed.frame + 1}"
            yield Taken(exposed, look, self.at(exposed.t_ns, look, said))

    def shots(self, most: int) -> Iterator[Shot]:
        """A picture of each of the first shots of which it is known where the camera looked."""
        looks = ((aim, self.outside.look_at(aim.aim_ns)) for aim in self.outside.shots)
        for aim, look in islice(looks, most):
            if look is not None:
                yield Shot(aim, look, self.at(aim.aim_ns, look, f"shot {aim.shot}, as aimed"))

    def at(self, t_ns: int, look: Direction, said: str) -> Picture:
        """What a camera sees that looks there at this instant."""
        states = [(id, path.at(t_ns / NS)) for id, path in self.paths.items()]
        vehicles = [Vehicle.of(id, state) for id, state in states if state is not None]
        words = f"{(t_ns - self.origin_ns) / NS:+.2f} s    {said}    pan {look.pan:+.1f}°   tilt {look.tilt:+.1f}°"
        trails = [trail for path in self.paths.values() if len(trail := self._trail(path, t_ns / NS)) > 1]
        return paint(Lens(self.outside.mount, look, self.optics), self._scenery, vehicles, trails, words)

    def _trail(self, path: Path, until_s: float) -> Array:
        """Where a target has been (n, 3) for a while, as far as that is near."""
        mount = self.outside.mount
        times = np.linspace(until_s - TRAIL_S, until_s, _TRAIL_STEPS + 1).tolist()
        points = [(state[0], state[1], 0.0) for t_s in times if (state := path.at(t_s)) is not None]
        found = np.array(points).reshape(-1, 3)
        return found[np.hypot(found[:, 0] - mount.x_m, found[:, 1] - mount.y_m) < NEARER_M]

    @cached_property
    def _exposed(self) -> list[tuple[Exposure, Direction]]:
        """The frames of which it is known where the camera looked."""
        found = ((one, self.outside.look_at(one.t_ns)) for one in self.outside.exposures)
        return [(one, look) for one, look in found if look is not None]

    @cached_property
    def _scenery(self) -> Scenery:
        return Scenery.around(self.outside.mount, self.sensors)
