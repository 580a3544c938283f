"""A sensor at a node: its readings as a pure function of the time."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import cos, hypot, isinf, sin, sqrt, tau
from typing import Any, Final, Self

from trackfield.draw import normal, uniform
from trackfield.errors import RunFailed
from trackfield.models.noise import Colour
from trackfield.sensing.complete import Kind
from trackfield.sensing.kinds import known_sensor, own_options
from trackfield.sensing.listening import Audible, Hear
from trackfield.sensing.readings import Reading, Window, window_at
from trackfield.sensing.sensing import Numbers
from trackfield.sensing.sensing import Scene as AnyScene
from trackfield.words import quoted
from trackfield.world.heard import NO_SOUNDS, Heard, Sounds
from trackfield.world.path import Path
from trackfield.world.scene import Scene, Still, left_at

_NS: Final = 1_000_000_000
PLAYED_NS: Final = 1000
"""A clock that is read in whole nanoseconds may be so much early for a recorded reading, at most."""
FRESH_NS: Final = 10_000_000
"""A recorded reading is gone after this time."""
NEVER_NS: Final = 1 << 62
Played = tuple[int, tuple[float, ...]]
"""(when, in ns; the numbers that were reported)"""


@dataclass(frozen=True, slots=True)
class Placed:
    """The sensor of node ``id`` at ``position`` (x, y in metres), and the targets that it may sense.

    ``windows`` hold all times at which any target may be within reach here, in order and disjoint; the paths of the
    ``scene`` are only used within them. Its noise is drawn for every instant, and so is whether there is a reading.
    ``threshold`` is the level from which its node reports. A sensor that has readings to be ``played`` reports these,
    in order of time, by itself; if only their ``times`` are, it reads its targets then. One whose kind finds passes in
    sound hears these ``sounds``.
    """

    id: str
    position: tuple[float, float]
    scene: Scene
    windows: tuple[Window, ...]
    kind: Kind
    options: Mapping[str, Any]
    threshold: float
    seed: int
    incarnation: int = 0
    played: tuple[Played, ...] | None = None
    times: bool = False
    sounds: Sounds = NO_SOUNDS
    heard: Heard | None = field(init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        lead_ns = round(self.kind.memory_s * _NS)
        heard = None if self.kind.hearing is None else Heard(self.windows, self._listen, lead_ns)
        object.__setattr__(self, "heard", heard)

    def _listen(self) -> Hear:
        assert self.kind.hearing is not None
        return self.kind.hearing(self.audible)

    @property
    def audible(self) -> Audible:
        """What there is to hear."""
        sounds = self.sounds.targets or (None,) * len(self.scene.paths)
        own = (self.seed, self.id, self.incarnation)
        return Audible(self.position, self.scene.paths, sounds, *own, *self.sounds[1:])

    def sample(self, t_ns: int) -> Reading | None:
        """The reading at this true time; None if nothing is sensed."""
        return self.latest(t_ns, FRESH_NS)

    def latest(self, t_ns: int, oldest_ns: int = NEVER_NS) -> Reading | None:
        """The same, but of a recording the latest reading that is no older than that."""
        if self.heard is not None:
            values = self.heard.at(t_ns)
            return None if values is None or self._misses(t_ns) else self.read(self.kind.biased(values, self.id), t_ns)
        if self.played is None:
            return None if self._misses(t_ns) else self._reading(self.scene, "reading", t_ns)
        i = bisect_right(self.played, t_ns + PLAYED_NS, key=lambda one: one[0]) - 1
        if i < 0 or t_ns - self.played[i][0] > oldest_ns:
            return None
        at_ns, values = self.played[i]
        return self._reading(self.scene, "reading", at_ns) if self.times else self.read(values, at_ns)

    def next_window(self, t_ns: int) -> int | None:
        """The start (ns) of the window that this time lies in, or else of the next; None after the last.

        For a kind that reports by itself, the next instant after this one at which it does; one that listens may have
        nothing to report then.
        """
        if self.heard is not None:
            return self.heard.next(t_ns)
        if self.kind.rhythm == "steps":
            return window_at(self.windows, t_ns)
        coming = (window for window in self.windows if window[1] > t_ns)
        return next((at for window in coming for at in self._events(window) if at > t_ns), None)

    def events(self) -> list[int]:
        """The instants (ns) at which a sensor reports by itself; of one that listens, as its kind foresees.

        Raises ``RunFailed`` for any outside its window.
        """
        return [at for window in self.windows for at in self._events(window)]

    def elsewhere(self, purpose: str, t_ns: int) -> Reading | None:
        """The reading of a target at rest at a random place in range, drawn for each purpose and instant."""
        r = self.kind.range_m * sqrt(self.uniform(purpose, "distance", t_ns))
        angle = tau * self.uniform(purpose, "bearing", t_ns)
        x, y = self.position
        return self._reading(Still((x + r * sin(angle), y + r * cos(angle), 0.0, 0.0)), purpose, t_ns)

    def read(self, values: Numbers, t_ns: int) -> Reading:
        """The reading of these numbers. Raises ``RunFailed`` if they cannot be reported."""
        try:
            return self.kind.reading(values)
        except ValueError as error:
            what = f"the sensor of {self.id}, at {t_ns / _NS:g} s: simulate returned {values!r}"
            raise RunFailed(f"{what}; expected None, or {error}") from None

    def uniform(self, purpose: str, what: str, t_ns: int) -> float:
        """A draw from [0, 1) that is its own."""
        return uniform(self.seed, self.id, self.incarnation, purpose, what, t_ns)

    def _events(self, window: Window) -> list[int]:
        """Those of a window, in order."""
        if self.played is not None:
            return [at for at, _ in self.played]
        found = self.kind.event(self.scene, window, self.position)
        try:
            return instants(found, window)
        except ValueError as error:
            raise RunFailed(f"the sensor of {self.id}: event {error}") from None

    def _reading(self, scene: AnyScene, purpose: str, t_ns: int) -> Reading | None:
        values = self.kind.simulate(scene, t_ns, self.position, self._normals(purpose, t_ns))
        return None if values is None else self.read(self.kind.biased(values, self.id), t_ns)

    def _misses(self, t_ns: int) -> bool:
        """Whether there is no reading at this time, whatever the target."""
        share = self.kind.missing
        return share > 0.0 and self.uniform("missing", "reading", t_ns) < share

    def _normals(self, purpose: str, t_ns: int) -> tuple[float, ...]:
        key = (self.seed, self.id, self.incarnation)
        if self.kind.draws:
            return tuple(normal(*key, name, t_ns) for name in self.kind.draws)
        white = (normal(*key, purpose, i, t_ns) for i in range(self.kind.n))
        colour = self.kind.colour
        return tuple(white if colour is None else (self._coloured(one, i, t_ns, colour) for i, one in enumerate(white)))

    def _coloured(self, white: float, i: int, t_ns: int, colour: Colour) -> float:
        """A draw from N(0, 1) of which only a share is its own; what is slow goes from one draw to the next.

        The draws are ``slow_s`` apart, and begin anywhere: so no instant is different from any other. They are the same
        in all lives of the node.
        """
        key = (self.seed, self.id, "slow", i)
        number, into = divmod(t_ns / (colour.slow_s * _NS) + uniform(*key), 1.0)
        before, after = (normal(*key, int(number) + k) for k in (0, 1))
        slow = (before * (1.0 - into) + after * into) / hypot(1.0 - into, into)
        fixed = normal(self.seed, self.id, "fixed", i)
        own = sqrt(max(1.0 - colour.slow - colour.fixed, 0.0))
        return own * white + sqrt(colour.slow) * slow + sqrt(colour.fixed) * fixed

    def _needed(self, path: Path) -> Path:
        """What its readings depend on: the path within the windows, and since what counts at their start left it."""
        speed_m_s, memory_s = self.kind.speed_m_s, self.kind.memory_s
        firsts = (a / _NS - memory_s for a, _ in self.windows)
        begins = (one if isinf(speed_m_s) else left_at(path, one, self.position, speed_m_s) for one in firsts)
        return path.cut(zip(begins, (b / _NS for _, b in self.windows), strict=True))

    def to_plain(self) -> dict[str, Any]:
        """The sensor in plain form: lists, numbers and text, and the parts of the paths that it needs."""
        return {
            "kind": self.kind.name,
            "options": dict(own_options(self.options, self.id)),
            "id": self.id,
            "position": list(self.position),
            "paths": [self._needed(path).to_plain() for path in self.scene.paths],
            "windows": [list(window) for window in self.windows],
            "threshold": self.threshold,
            "seed": self.seed,
            "incarnation": self.incarnation,
            **({} if self.played is None else self._to_be_played()),
            **({} if self.sounds == NO_SOUNDS else {"sounds": [list(self.sounds.targets), *self.sounds[1:]]}),
        }

    def _to_be_played(self) -> dict[str, Any]:
        times, readings = [at for at, _ in self.played or ()], [list(values) for _, values in self.played or ()]
        return {"recorded": True, "times": times, **({} if self.times else {"readings": readings})}

    @classmethod
    def from_plain(cls, plain: Mapping[str, Any]) -> Self:
        """The inverse of ``to_plain``."""
        x, y = plain["position"]
        times, readings = plain.get("times"), plain.get("readings")
        played = None if times is None else tuple(zip(times, map(tuple, readings or [()] * len(times)), strict=True))
        sounds, *recording = plain.get("sounds", [()])
        return cls(
            plain["id"],
            (x, y),
            Scene(tuple(map(Path.from_plain, plain["paths"]))),
            tuple((a, b) for a, b in plain["windows"]),
            known_sensor(plain["kind"], plain["options"], recorded=played is not None),
            plain["options"],
            plain["threshold"],
            plain["seed"],
            plain["incarnation"],
            played,
            readings is None and played is not None,
            Sounds(tuple(sounds), *recording),
        )


def instants(found: Any, window: Window) -> list[int]:
    """What a kind's ``event`` returned for a window, in order. Raises ``ValueError`` for anything outside of it."""
    try:
        several = () if found is None else tuple(found)
    except TypeError:  # a single number
        several = (found,)
    try:
        times = sorted({int(at) for at in several})
    except (TypeError, ValueError, OverflowError):
        times = [window[0] - 1]
    if not times or window[0] <= times[0] <= times[-1] <= window[1]:
        return times
    what = f"returned {quoted(found)} for the window {window}"
    raise ValueError(f"{what}; expected None, or one or several instants (ns) in it")
