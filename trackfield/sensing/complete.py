"""A kind of sensing with everything that others ask of it: what a class leaves out is filled in here, once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from copy import copy
from dataclasses import replace
from functools import partial
from math import dist, inf, isfinite
from typing import TYPE_CHECKING, Any, Final

from trackfield.models.noise import Colour
from trackfield.models.unknowns import Unknown
from trackfield.sensing.listening import Audible, Hear
from trackfield.sensing.readings import Measured, Reading
from trackfield.sensing.sensing import Numbers, Point, Scene, Uniform
from trackfield.wire.messages import Measurement

if TYPE_CHECKING:
    from trackfield.filters.types import Array, Gaussian, PassNoise

MOST_STEPS: Final = 10**15
"""The largest number of a report (docs/wire.md)."""
LAST_STEP: Final = 65535
"""The highest step that a report can hold."""
SEARCHED: Final = 200
"""Instants of a window, at least, that are looked at for the closest ones."""
SEARCHED_NS: Final = 250_000_000
"""How far apart they are at most."""
SETTLED_NS: Final = 1000
TURNED_M: Final = 0.001
"""By how much a target comes nearer, and goes away again, when it passes."""
FIELD: Final = 4
"""The arguments of ``simulate`` for a kind that gets the whole scene."""
NEAREST: Final = 3
"""The same for a kind that gets the nearest target alone."""
METHODS: Final = (
    *("residual", "loudness", "level", "z", "reading", "values", "words", "drawn", "longest", "event"),
    *("biased", "corrected", "possible"),
)
"""Methods that a class may have; there are defaults for them."""
METHODS_OR_NONE: Final = ("variance", "log_clutter", "fix", "invented", "hearing")
"""The same, without a default."""
PASS_NOISE: Final = ("time_sd_s", "strength_sd", "place_sd_m")
"""Fields of a class that reports passes: standard deviations, which trackers may take to be larger."""
OPEN: Final = -1
"""Their number if it is open."""
_VARARGS: Final = 0x04
"""The flag of functions with ``*args`` (``inspect.CO_VARARGS``)."""


class Kind:
    """The kind ``name`` as ``own`` has it, with defaults for what it lacks; the members of ``sensing.Full``.

    Those of ``METHODS_OR_NONE`` are None where there is none. Of the ``n`` numbers of a reading ``h`` predicts the
    first ``m``. One that is ``recorded`` is of sensors that play what real ones reported: they report by themselves,
    whatever the level, in messages that say when the reading was made.
    """

    simulate: Callable[[Scene, int, Point, tuple[float, ...]], Numbers | None]
    h: Callable[[Array, Array], Array]
    jacobian: Callable[[Array, Array], Array]
    variance: Callable[[Array, Array], Array] | None
    residual: Callable[[Array], Array]
    log_clutter: Callable[[Array, Array], Array] | None
    fix: Callable[[Array, Array, Array], Gaussian | None] | None
    invented: Callable[[str, float, Uniform], Numbers | None] | None
    hearing: Callable[[Audible], Hear] | None
    loudness: Callable[[Array], Array]
    level: Callable[[Numbers], float]
    z: Callable[[Array], Array]
    reading: Callable[[Numbers], Reading]
    values: Callable[[Any], Numbers]
    words: Callable[[Any], str]
    drawn: Callable[[Numbers], float]
    longest: Callable[[], Any]
    event: Callable[[Scene, tuple[int, int], Point], int | Iterable[int] | None]
    biased: Callable[[Numbers, str], Numbers]
    corrected: Callable[[Numbers, str], Numbers]
    possible: Callable[[Numbers], bool]

    def __init__(self, name: str, own: Any, *, recorded: bool = False) -> None:
        self.name, self.own, self.recorded = name, own, recorded
        has: Callable[[str, Any], Any] = partial(getattr, own)
        self.range_m = float(own.range_m)
        self.sd, self.resolution = tuple(own.sd), tuple(own.resolution)
        self.m, self.n = len(self.sd), len(self.resolution)
        self.unknowns: tuple[Unknown, ...] = tuple(has("unknowns", ()))
        self.units: tuple[str, ...] = tuple(has("units", ("",) * self.n))
        self.thresholds: tuple[float, float] | None = has("thresholds", None)
        self.report_m = float(has("report_m", self.range_m))
        self.fix_sensors = int(has("fix_sensors", 2 if self.m == 1 else 1))
        self.speed_m_s = float(has("speed_m_s", inf))
        self.memory_s = float(has("memory_s", 0.0))
        self.layer: str = has("layer", "")
        self.summary: str = has("summary", name)
        self.bearings: bool = has("bearings", False)
        self.message: type = has("message", Measurement)
        self.rhythm: str = has("rhythm", "steps")
        self.draws: tuple[str, ...] | None = has("draws", None)
        self.colour: Colour | None = has("colour", None)
        self.passes: PassNoise | None = own if has("passes", False) else None
        self.missing = float(has("missing", 0.0))
        self.modules: tuple[str, ...] = tuple(has("modules", ()))
        self.simulate = own.simulate if arguments(own.simulate) == FIELD else self._of_nearest
        self.h, self.jacobian = own.h, own.jacobian
        for method in METHODS:
            setattr(self, method, has(method, None) or getattr(self, f"_{method}"))
        for method in METHODS_OR_NONE:
            setattr(self, method, has(method, None))
        if recorded:
            self._play()

    def _play(self) -> None:
        """Sensors report by themselves what was recorded."""
        self.rhythm, self.thresholds, self.message = "events", None, Measurement
        self.hearing, self.modules = None, ()
        for method in ("reading", "values", "words", "longest"):
            setattr(self, method, getattr(self, f"_{method}"))

    def assumed(self, noise: float) -> Kind:
        """The kind for trackers that take its noise to be so many times what it is; a ``fix`` of its own does not."""
        if noise == 1.0:
            return self
        found, variance = copy(self), self.variance
        found.sd = tuple(noise * sd for sd in self.sd)
        if variance is not None:
            found.variance = lambda x, at: noise**2 * variance(x, at)
        if self.passes is not None:
            found.passes = replace(self.own, **{name: noise * getattr(self.own, name) for name in PASS_NOISE})
        return found

    @property
    def threshold(self) -> float:
        """The level from which a node reports until it is told another; minus infinity if it reports all."""
        return -inf if self.thresholds is None else sum(self.thresholds) / 2

    @property
    def adaptive(self) -> bool:
        """Whether whoever tracks sets the threshold."""
        return self.thresholds is not None and self.thresholds[0] != self.thresholds[1]

    @property
    def timed(self) -> bool:
        """Whether reports say when they were made, as sensors report by themselves."""
        return self.rhythm == "events" and self.message is Measurement

    def early_s(self, message: Any) -> float:
        """How long before the instant of its step a reading was made."""
        return float(message.values[-1]) * 1e-6 if self.timed else 0.0

    def takes(self, message: Any) -> bool:
        """Whether a message is a report of this kind."""
        if isinstance(message, Measurement):
            return self.message is Measurement and len(message.values) == self.n + self.timed
        return isinstance(message, self.message)

    # --- defaults of METHODS ---

    def _residual(self, difference: Array) -> Array:
        return difference

    def _z(self, values: Array) -> Array:
        return values

    def _loudness(self, z: Array) -> Array:
        """All sensors are equally loud."""
        return z[..., 0] * 0.0

    def _level(self, values: Numbers) -> float:
        return inf

    def _biased(self, values: Numbers, id: str) -> Numbers:
        """All sensors are alike."""
        return values

    _corrected = _biased

    def _possible(self, values: Numbers) -> bool:
        return True

    def _of_nearest(self, scene: Scene, t_ns: int, place: Point, normals: tuple[float, ...]) -> Numbers | None:
        """For a class whose ``simulate`` takes the nearest target: that, if it is within range."""
        x, y = place
        near = [((state[0] - x) ** 2 + (state[1] - y) ** 2, state) for state in scene.at(t_ns)]
        if not near:
            return None
        square, nearest = min(near, key=lambda one: one[0])
        if square > self.range_m**2:
            return None
        values: Numbers | None = self.own.simulate(nearest, place, normals)
        return values

    def _reading(self, values: Numbers) -> Measured:
        """In steps of the resolution. Raises ``ValueError`` for numbers that cannot be reported."""
        if len(values) == self.n and all(map(isfinite, values)):
            steps = tuple(round(value / step) for value, step in zip(values, self.resolution, strict=True))
            if max(map(abs, steps)) <= MOST_STEPS:
                return Measured(steps, tuple(values), self.level(values), self.timed)
        raise ValueError(f"{self.n} numbers of at most {MOST_STEPS:.0e} steps of their resolution")

    def _values(self, message: Measurement) -> Numbers:
        return tuple(number * step for number, step in zip(message.values, self.resolution, strict=False))

    def _words(self, message: Any) -> str:
        numbers = zip(self.values(message), self.units, strict=True)
        return f"{self.name} {', '.join(f'{value:.6g} {unit}'.strip() for value, unit in numbers)}"

    def _drawn(self, values: Numbers) -> float:
        return values[0]

    def _longest(self) -> Measurement:
        return Measurement(LAST_STEP, (2**15 - 1,) * self.n + (2**20,) * self.timed)

    def _event(self, scene: Scene, window: tuple[int, int], place: Point) -> tuple[int, ...]:
        """When each target is closest to the sensor within a window, to a microsecond: each time that it turns away.

        It comes nearer before, and within range. A target that appears or vanishes nearby does not pass.
        """
        found = (at for one in scene.alone() for at in closest(one, window, place, self.range_m))
        return tuple(sorted(found))


def closest(scene: Scene, window: tuple[int, int], place: Point, range_m: float) -> Iterator[int]:
    """When (ns) the only target of a scene is closest to a place, each time that it comes within range."""

    def away_m(t_ns: int) -> float:
        return min((dist(state[:2], place) for state in scene.at(t_ns)), default=inf)

    begin, end = window
    step = max(min((end - begin) // SEARCHED, SEARCHED_NS), 1)
    for at in _lowest((t_ns, away_m(t_ns)) for t_ns in range(begin, end + 1, step)):
        low, high = at - step, at + step
        while high - low > SETTLED_NS:
            third = (high - low) // 3
            low, high = (low, high - third) if away_m(low + third) <= away_m(high - third) else (low + third, high)
        if away_m(low) <= range_m:
            yield low


def _lowest(curve: Iterable[tuple[int, float]]) -> Iterator[int]:
    """Where a curve is lowest between a fall and a rise, both of more than ``TURNED_M``; it begins anew after a gap."""
    top, low, at, falling = inf, inf, 0, False
    for t_ns, value in curve:
        if not isfinite(value):
            top, falling = inf, False
        elif not isfinite(top):
            top = value
        elif not falling:
            top = max(top, value)
            falling, low, at = value < top - TURNED_M, value, t_ns
        elif value < low:
            low, at = value, t_ns
        elif value > low + TURNED_M:
            yield at
            top, falling = value, False


def arguments(method: Any) -> int:
    """How many arguments a method takes by position, besides its object; ``OPEN`` with ``*args`` or defaults."""
    function = getattr(method, "__func__", method)
    code = getattr(function, "__code__", None)
    if code is None or code.co_flags & _VARARGS or function.__defaults__:
        return OPEN
    return int(code.co_argcount) - (function is not method)
