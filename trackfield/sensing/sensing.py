"""The interface of a kind of sensing: what a class has to have, and what it may have.

A kind is a frozen dataclass whose fields a scenario sets in ``[sensor]``. Nodes call ``simulate`` alone, and need no
numpy for it; trackers, bounds and pictures call the rest. Trackfield's own kinds and users' go through the same door
(``kinds.make_sensor``), and what a class leaves out is filled in there (``complete.Kind``).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, Final, Literal, Protocol

from trackfield.models.noise import Colour
from trackfield.models.unknowns import Unknown
from trackfield.sensing.readings import Reading

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from trackfield.filters.types import Gaussian
    from trackfield.sensing.listening import Audible, Hear

    Array = NDArray[np.float64]

Point = tuple[float, float]
"""Metres east and north."""
State = tuple[float, float, float, float]
"""(x, y, vx, vy) in metres and metres per second."""
Numbers = Sequence[float]
Uniform = Callable[[str], float]
"""A draw from [0, 1) for a purpose: the same for the same purpose."""


IMPOSSIBLE_SD: Final = 6.0
"""How many sds from all that a target anywhere gives a reading is impossible: noise does that once in 10^9 readings."""
LAYERS: Final = ("rays", "rings", "discs")
"""How the timeline can draw readings (``launcher/timeline/layers``)."""


class Scene(Protocol):
    """All targets that a sensor may sense."""

    def at(self, t_ns: int) -> Sequence[State]:
        """Where they are at this true time; those that are there."""
        ...

    def retarded(self, t_ns: int, place: Point, speed_m_s: float) -> Sequence[State]:
        """Where they were when what arrives at ``place`` now left them, at ``speed_m_s``."""
        ...

    def alone(self) -> Sequence[Scene]:
        """The scene of each target, as if there were no other."""
        ...


class Sensing(Protocol):
    """What each kind has: n numbers in a reading, of which the first m are z = h(x) + noise."""

    @property
    def range_m(self) -> float:
        """Beyond this distance (m) from the target nothing is measured, and its node sleeps."""
        ...

    @property
    def sd(self) -> Numbers:
        """The noise's standard deviations (m,), in the units of ``h``."""
        ...

    @property
    def resolution(self) -> Numbers:
        """The resolution with which each number is reported (n,)."""
        ...

    def simulate(self, scene: Scene, t_ns: int, place: Point, normals: tuple[float, ...]) -> Numbers | None:
        """The reading (n,) at ``place`` at this instant; None if nothing is measured.

        ``normals`` (n,) are draws from N(0, 1), the only randomness that it may have. With three arguments,
        ``simulate(target, place, normals)``, it gets the state of the nearest target within range instead.
        """
        ...

    def h(self, x: Array, at: Array) -> Array:
        """Noiseless readings (..., K, m) of states ``x`` (..., 4 + unknowns) by sensors ``at`` (K, 2)."""
        ...

    def jacobian(self, x: Array, at: Array) -> Array:
        """dh/dx (..., K, m, 4 + unknowns)."""
        ...


class Full(Sensing, Protocol):
    """What a kind may have besides; docs/extending.md says what holds without it."""

    unknowns: tuple[Unknown, ...]
    """What h depends on beyond (x, y, vx, vy), in the order of its columns."""
    units: tuple[str, ...]
    """The unit of each number, such as ``m`` or ``deg``: for words, and for a ``bias`` in these units."""
    thresholds: tuple[float, float] | None
    """The lowest and highest level from which a node reports: one level, or set by whoever tracks; None: any."""
    report_m: float
    """The distance (m) up to which a node reports at its lowest threshold; it is awake as far as ``range_m``."""
    fix_sensors: int
    """How many sensors determine a position."""
    speed_m_s: float
    """How fast what it senses travels, if ``simulate`` uses ``Scene.retarded``; infinite: at once."""
    memory_s: float
    """How long ago (s) what counts in a reading may have arrived."""
    rhythm: Literal["steps", "events"]
    """Whether it is read at each step, or reports by itself, at each pass of a target (``event``)."""
    colour: Colour | None
    """What of its noise is not drawn anew for every reading; None: nothing."""
    missing: float
    """The share of its readings that are not there."""
    modules: tuple[str, ...]
    """What its nodes have to import, beyond what all do; they are forked from a process that has it."""
    passes: bool
    """Whether its readings begin with (time s, strength dB, width s) of a target's pass, as those of ``cpa`` do."""
    summary: str
    """What it measures, in a few words for reports."""
    layer: str
    """How the timeline draws a reading (``launcher/timeline/layers``); empty: not at all."""

    def variance(self, x: Array, at: Array) -> Array:
        """R(x) (..., K, m): the variances of the noise, which ``sd`` is in the middle of."""
        ...

    def residual(self, difference: Array) -> Array:
        """Differences of readings (..., m) in their valid range, as for angles."""
        ...

    def log_clutter(self, z: Array, at: Array) -> Array:
        """Log density (K,) of readings ``z`` (K, n) that come from anywhere but the target."""
        ...

    def fix(self, z: Array, at: Array, anywhere: Array) -> Gaussian | None:
        """A start from the readings ``z`` (K, n) of one step; ``anywhere`` is the covariance without information."""
        ...

    def loudness(self, z: Array) -> Array:
        """How loud each reading is, in dB (K,), of ``z`` (K, n): the weight of a sensor beside others."""
        ...

    def level(self, values: Numbers) -> float:
        """What of a reading is compared with the threshold."""
        ...

    def event(self, scene: Scene, window: tuple[int, int], place: Point) -> int | Iterable[int] | None:
        """When (true ns) in a window, in which a target may be within range, a sensor reports by itself.

        An instant, several, or None. Of several for one step a node reports the first.
        """
        ...

    def hearing(self, audible: Audible) -> Hear:
        """How a sensor listens that finds passes in sound; it reports them, and ``event`` is a forecast."""
        ...

    def reading(self, values: Numbers) -> Reading:
        """The reading that consists of these numbers, as it is reported."""
        ...

    def values(self, message: Any) -> Numbers:
        """The numbers (n,) that a message reports, in the kind's ``units``."""
        ...

    def biased(self, values: Numbers, id: str) -> Numbers:
        """The numbers (n,) of a reading as the sensor ``id`` has them, which is not quite like the others."""
        ...

    def corrected(self, values: Numbers, id: str) -> Numbers:
        """The inverse of ``biased``, for whoever uses reports of the sensor ``id``."""
        ...

    def possible(self, values: Numbers) -> bool:
        """Whether a target anywhere may give such a reading (n,); whoever tracks has no use for others."""
        ...

    def z(self, values: Array) -> Array:
        """Reported numbers (K, n) in the units of ``h``."""
        ...

    def invented(self, fault: str, threshold: float, uniform: Uniform) -> Numbers | None:
        """The numbers that a sensor which is ``stuck`` or babbles (``babble``) reads although there is nothing."""
        ...

    def words(self, message: Any) -> str:
        """A message in words."""
        ...

    def drawn(self, values: Numbers) -> float:
        """What the timeline draws of a reading.

        The bearing (deg, clockwise from north) of a ray, the radius (m) of a ring, how large a disc is, from 0 to 1.
        """
        ...

    def longest(self) -> Any:
        """A message that is as long as any."""
        ...
