"""``energy``: a microphone that measures the energy of the sound that it receives; energies of several targets add up.

Yu et al. (2009): y = g S / d^alpha + noise. What the target emits, S, is not known: trackers estimate its logarithm
beside position and velocity. The noise has a part that grows with what is received, so that near sensors are no more
precise, in relative terms, than their calibration.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import hypot, inf, log, sqrt
from typing import TYPE_CHECKING, Any, ClassVar, Final

from trackfield.models.unknowns import Unknown
from trackfield.sensing.readings import Said
from trackfield.sensing.sensing import IMPOSSIBLE_SD, Numbers, Point, Scene, Uniform
from trackfield.wire.messages import Energy as EnergyMessage

if TYPE_CHECKING:
    from trackfield.filters.types import Array, Gaussian

MOST: Final = 1e12
"""The largest energy that a report holds (docs/wire.md)."""
PARTS: Final = ((0.0694318442029737, 0.1739274225687269), (0.3300094782075719, 0.3260725774312731))
"""Where a window is looked at, and with which weight: Gauss and Legendre's nodes of its first half; four in all."""
SILENCE_SD: Final = 3.0
"""How far below 0 a reading may be, in sds of the noise."""
LOUDEST: Final = 4
"""How many of the loudest sensors say where a track starts."""
BEYOND_ALL: Final = 300.0
"""The logarithm of an energy whose square, as variances have it, is still a number."""


@dataclass(frozen=True)
class Energy:
    """Mean power (relative to a reference) of the sound of all targets, if one is within ``range_m``.

    A target that emits ``emitted`` is received with ``gain`` times that over distance to the power ``alpha``, closer
    than ``floor_m`` as there. The variance of the noise is that of the surroundings, ``noise`` squared, and that of the
    calibration, (``relative`` x what is received) squared. Trackers know the emitted energy but for ``emitted_sd`` in
    its logarithm, which changes by ``emitted_walk`` in a second. A reading is the mean over the last ``window_s``
    seconds before its step; sound travels at ``sound_m_s``, or at once if that is 0. With ``compensate_window``
    trackers take a reading to be of the middle of its window, with ``compensate_delay`` of a sound that left before.
    A sensor of the ``gains`` (by id) reads so many times what others do, noise included, which trackers take off; the
    share ``missing`` of all readings is not there.
    """

    range_m: float = 150.0
    emitted: float = 1e5
    alpha: float = 2.0929
    gain: float = 1.0
    floor_m: float = 2.0
    noise: float = 0.9298
    relative: float = 0.2
    emitted_sd: float = 0.1
    emitted_walk: float = 0.01
    window_s: float = 0.0
    sound_m_s: float = 0.0
    compensate_window: bool = True
    compensate_delay: bool = True
    missing: float = 0.0
    gains: Mapping[str, float] = field(default_factory=dict)

    message: ClassVar[type] = EnergyMessage
    units: ClassVar = ("",)
    resolution: ClassVar = (0.001,)
    fix_sensors: ClassVar = 4
    layer: ClassVar = "discs"

    @property
    def summary(self) -> str:
        """See ``Full``."""
        return f"received energy (noise {self.noise:g}, calibration to {100.0 * self.relative:g} %)"

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """See ``Full``."""
        return (Unknown("log_emitted", self.emitted_sd, self.emitted_walk, log(self.emitted)),)

    @property
    def speed_m_s(self) -> float:
        """See ``Full``."""
        return self.sound_m_s or inf

    @property
    def memory_s(self) -> float:
        """See ``Full``."""
        return self.window_s

    def _received(self, distance_m: float) -> float:
        return self.gain * self.emitted * float(max(distance_m, self.floor_m) ** -self.alpha)

    def _sd(self, received: float) -> float:
        return hypot(self.noise, self.relative * received)

    @property
    def sd(self) -> tuple[float, ...]:
        """See ``Sensing``: that in the middle of its range."""
        return (self._sd(self._received(self.range_m / 2.0)),)

    # --- in nodes ---

    def simulate(self, scene: Scene, t_ns: int, place: Point, normals: tuple[float, ...]) -> Numbers | None:
        """See ``Sensing``."""
        heard = [(share, self._heard(scene, t_ns - round(ago_s * 1e9), place)) for ago_s, share in self.parts]
        if min((away for _, each in heard for away in each), default=inf) > self.range_m:
            return None
        received = sum(share * sum(map(self._received, each)) for share, each in heard)
        return (received + self._sd(received) * normals[0],)

    @cached_property
    def parts(self) -> tuple[tuple[float, float], ...]:
        """How long ago (s) what a reading is made of was received, and with which share."""
        if not self.window_s:
            return ((0.0, 1.0),)
        return tuple((self.window_s * at, share) for one, share in PARTS for at in (one, 1.0 - one))

    def _heard(self, scene: Scene, t_ns: int, place: Point) -> list[float]:
        """How far away (m) the targets were that are heard at a time."""
        there = scene.retarded(t_ns, place, self.sound_m_s) if self.sound_m_s else scene.at(t_ns)
        return [hypot(x - place[0], y - place[1]) for x, y, *_ in there]

    def biased(self, values: Numbers, id: str) -> Numbers:
        """See ``Full``."""
        return (values[0] * self.gains.get(id, 1.0),)

    def corrected(self, values: Numbers, id: str) -> Numbers:
        """See ``Full``."""
        return (values[0] / self.gains.get(id, 1.0),)

    def possible(self, values: Numbers) -> bool:
        """See ``Full``: not farther below silence than by noise."""
        return values[0] >= -IMPOSSIBLE_SD * self.noise

    def reading(self, values: Numbers) -> Said:
        """See ``Full``."""
        return Said.limited(EnergyMessage, values)

    def invented(self, fault: str, threshold: float, uniform: Uniform) -> Numbers:
        """See ``Full``: the energy of a target anywhere within range."""
        return (self._received(self.range_m * sqrt(uniform("distance"))),)

    def values(self, message: Any) -> Numbers:
        """See ``Full``."""
        return (message.energy,)

    def longest(self) -> EnergyMessage:
        """See ``Full``."""
        return EnergyMessage(65535, MOST)

    # --- where they are used ---

    def h(self, x: Array, at: Array) -> Array:
        """See ``Sensing``."""
        return self._expected(x, self._distances(x, at))[..., None]

    def jacobian(self, x: Array, at: Array) -> Array:
        """See ``Sensing``."""
        import numpy as np

        away, slopes = self._distances_and_slopes(x, at)
        fall = np.where(away > self.floor_m, -self.alpha / np.maximum(away, self.floor_m), 0.0)
        relative = fall[..., None] * slopes
        relative[..., 4] = 1.0
        found: Array = (self._expected(x, away)[..., None] * relative)[..., None, :]
        return found

    def _expected(self, x: Array, away: Array) -> Array:
        """What is received (..., K) of states x over these distances (..., K)."""
        import numpy as np

        level = log(self.gain) + x[..., None, 4] - self.alpha * np.log(np.maximum(away, self.floor_m))
        found: Array = np.exp(np.minimum(level, BEYOND_ALL))
        return found

    def _distances(self, x: Array, at: Array) -> Array:
        """How far away (..., K) the target was that a sensor hears now."""
        from trackfield.models import ranging

        x, speed = self._middle(x), self._compensated_m_s
        return speed * ranging.delays(x, at, speed) if speed else ranging.distances(x, at)

    def _distances_and_slopes(self, x: Array, at: Array) -> tuple[Array, Array]:
        """The same, and their derivatives (..., K, n)."""
        from trackfield.models import ranging

        x, speed = self._middle(x), self._compensated_m_s
        if speed:
            away, slopes = (speed * one for one in ranging.delays_and_slopes(x, at, speed))
        else:
            away, slopes = ranging.distances_and_slopes(x, at)
        slopes[..., 2:4] -= self._back_s * slopes[..., :2]
        return away, slopes

    def _middle(self, x: Array) -> Array:
        """The states at the instant of which trackers take a reading to be."""
        if not self._back_s:
            return x
        found = x.copy()
        found[..., :2] -= x[..., 2:4] * self._back_s
        return found

    @property
    def _back_s(self) -> float:
        return self.window_s / 2.0 if self.compensate_window else 0.0

    @property
    def _compensated_m_s(self) -> float:
        return self.sound_m_s if self.compensate_delay else 0.0

    def variance(self, x: Array, at: Array) -> Array:
        """See ``Full``."""
        return self.variance_of(self.h(x, at))

    def variance_of(self, received: Array) -> Array:
        """The variances of the noise of what is received, from one target or from several."""
        found: Array = self.noise**2 + (self.relative * received) ** 2
        return found

    def loudness(self, z: Array) -> Array:
        """See ``Full``."""
        import numpy as np

        found: Array = 10.0 * np.log10(np.maximum(z[..., 0], self.noise))
        return found

    def fix(self, z: Array, at: Array, anywhere: Array) -> Gaussian | None:
        """See ``Full``: the centroid of the loudest sensors, as wide as they are apart (Yu et al. start anew there)."""
        import numpy as np

        from trackfield.filters.types import Gaussian

        if len(z) < LOUDEST:
            return None
        loudest = np.argsort(-z[:, 0], kind="stable")[:LOUDEST]
        spread = float(np.sqrt(np.square(at[loudest] - at[loudest].mean(axis=0)).sum(axis=1).mean() / 2.0))
        covariance = anywhere.copy()
        covariance[:2, :2] = np.eye(2) * max(spread, self.floor_m) ** 2
        return Gaussian(np.append(at[loudest].mean(axis=0), [0.0, 0.0]), covariance)

    def log_clutter(self, z: Array, at: Array) -> Array:
        """See ``Full``: any level in dB from the noise to the loudest is as likely.

        What the noise makes of silence, down to ``SILENCE_SD``, is as likely as a reading at its level.
        """
        import numpy as np

        span = max(log(self._received(self.floor_m) / self.noise), 0.0)
        found: Array = -np.log(np.maximum(z[:, 0], self.noise) * (span + 1.0 + SILENCE_SD))
        return found

    def drawn(self, values: Numbers) -> float:
        """See ``Full``: its level above the noise, in dB, as a share of that of the loudest."""
        span = max(log(self._received(self.floor_m) / self.noise), 1e-9)
        return min(log(max(values[0] / self.noise, 1.0)) / span, 1.0)
