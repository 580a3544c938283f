"""``cpa``: a microphone that notices when a target passes: the closest point of approach, when it is loudest.

Yang et al.: a sensor reports when it heard the target loudest, and how loud. Time and strength have noise; the time's
may grow with the distance and fall with the speed. With ``waveform`` sound is synthesised, or played from a recording,
and a detector finds the passes in it (``trackfield/acoustics``).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from math import dist, hypot, inf, log, log10, sqrt
from typing import TYPE_CHECKING, Any, ClassVar, Final

from trackfield.models.noise import SLOWEST_M_S, USUAL_M_S, T, time_sd
from trackfield.models.unknowns import Unknown
from trackfield.sensing.complete import closest
from trackfield.sensing.listening import Audible, Hear, hearing
from trackfield.sensing.readings import Window
from trackfield.sensing.sensing import Numbers, Point, Scene, Uniform
from trackfield.wire.passes import EVENTS, MOST_EARLY_S, CpaReport, CpaReportSds

if TYPE_CHECKING:
    from trackfield.filters.types import Array

_NS: Final = 1_000_000_000
KNOWN_NS: Final = _NS
"""So long after a target was loudest its sensor knows that it was (trackfield/acoustics/listener.py)."""
LATER_NS: Final = _NS // 10
"""In sound it knows so much later still, as a rule; twice that at most."""
LEAD_S: Final = 5.0
"""So much of the sound before a target comes within range is heard, too."""
NEAREST_M: Final = 1.0
"""A target that is nearer is as loud as here."""
WIDTH_SD: Final = 0.05
"""The relative standard deviation of a pulse's width."""
DB: Final = 20.0 / log(10.0)
"""dB of amplitude in a unit of its natural logarithm."""
LONGEST_S: Final = 6.0
"""A wider pulse is not told from changes of the surroundings (trackfield/acoustics/listener.py): none of who stands."""
BESIDE_NS: Final = 10_000_000
"""So long before and after it passes, a target is farther away."""
WEAKEST_DB, STRONGEST_DB, WIDEST_S, LEAST_SURE_DB = -100.0, 200.0, 6.375, 100.0
"""What reports hold (docs/wire.md)."""


@dataclass(frozen=True, slots=True)
class Passed:
    """A target passed: ``values`` are (time s relative to this reading's instant, strength dB, width s).

    They may be followed by the standard deviations of time (s) and strength (dB).
    """

    values: tuple[float, ...]
    level: float = inf

    def report(self, step: int, early_ns: int = 0) -> CpaReport | CpaReportSds:
        """The message that reports it for a step, whose instant is ``early_ns`` later than this reading's."""
        time_s, strength_db, width_s, *sds = self.values
        early_s = min(early_ns / _NS - time_s, MOST_EARLY_S)
        kind = CpaReportSds if sds else CpaReport
        return kind(step, early_s, step % EVENTS, strength_db, width_s, *sds)


@dataclass(frozen=True)
class Cpa:
    """When a target that comes within ``range_m`` was loudest at a sensor, and how loud.

    Sound travels at ``sound_m_s``, or at once if that is 0. The standard deviation of the time is ``time_sd_s`` x
    (distance / ``time_at_m``)^``distance_power`` x (13.4 m/s / speed)^``speed_power``, nearer than ``time_floor_m`` as
    there. The amplitude falls with the distance, from ``source_db`` at 1 m: trackers know that but for
    ``source_sd_db``. Its standard deviation is the share ``strength_sd`` of it. Trackers use it if ``use_strength``.
    They know sensors' places but for ``place_sd_m``. The share ``loss`` of all passes is not noticed. With
    ``variances`` reports say how precise they are. With ``waveform`` the ``detector`` finds passes in sound that is
    ``snr_db`` louder than the surroundings' noise at ``snr_at_m``; all that is said of noise is then what trackers
    assume.
    """

    range_m: float = 50.0
    sound_m_s: float = 340.0
    source_db: float = 0.0
    source_sd_db: float = 0.0
    time_sd_s: float = 0.1
    time_floor_m: float = 3.0
    time_at_m: float = 12.0
    distance_power: float = 0.0
    speed_power: float = 0.0
    strength_sd: float = 0.1
    use_strength: bool = True
    loss: float = 0.0
    variances: bool = False
    waveform: bool = False
    detector: str = "fit"
    snr_db: float = 10.0
    snr_at_m: float = 20.0
    place_sd_m: float = 0.0

    rhythm: ClassVar = "events"
    passes: ClassVar = True
    fix_sensors: ClassVar = 4
    layer: ClassVar = "discs"

    @property
    def message(self) -> type:
        """See ``Full``."""
        return CpaReportSds if self.variances else CpaReport

    @property
    def units(self) -> tuple[str, ...]:
        """See ``Full``."""
        return ("s", "dB", "s", *(("s", "dB") if self.variances else ()))

    @property
    def resolution(self) -> tuple[float, ...]:
        """See ``Sensing``."""
        return (0.0001, 0.01, 0.025, *((0.0001, 0.01) if self.variances else ()))

    @property
    def sd(self) -> tuple[float, ...]:
        """See ``Sensing``: that in the middle of its range, at 13.4 m/s."""
        time_sd_s = self.time_sd(self.range_m / 2.0, USUAL_M_S)
        return (time_sd_s, self._strength_sd_db) if self.use_strength else (time_sd_s,)

    @property
    def summary(self) -> str:
        """See ``Full``."""
        strengths = f", and strengths to {100.0 * self.strength_sd:g} %" if self.use_strength else ""
        heard = f", found in sound by the detector '{self.detector}'" if self.waveform else ""
        return f"times of passes (sd {self.time_sd_s:g} s){strengths}{heard}"

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """See ``Full``."""
        known = not self.use_strength or not self.source_sd_db
        return () if known else (Unknown("source_db", self.source_sd_db, 0.0, self.source_db),)

    @property
    def speed_m_s(self) -> float:
        """See ``Full``."""
        return self.sound_m_s or inf

    @property
    def memory_s(self) -> float:
        """See ``Full``."""
        return LEAD_S if self.waveform else KNOWN_NS / _NS

    @property
    def missing(self) -> float:
        """See ``Full``."""
        return self.loss

    @property
    def modules(self) -> tuple[str, ...]:
        """See ``Full``."""
        return ("trackfield.acoustics.listener", "trackfield.acoustics.microphone") if self.waveform else ()

    @property
    def hearing(self) -> Callable[[Audible], Hear] | None:
        """See ``Full``; None of a sensor that knows of passes without hearing them."""
        return partial(hearing, self) if self.waveform else None

    @property
    def _strength_sd_db(self) -> float:
        return DB * self.strength_sd

    def time_sd(self, away_m: T, speed_m_s: T, *, larger: Any = max) -> T:
        """The sd (s) of the time of a pass, or of arrays of them (``trackfield/models/noise.py``)."""
        near = {"floor_m": self.time_floor_m, "at_m": self.time_at_m}
        powers = {"p": self.distance_power, "q": self.speed_power}
        return time_sd(away_m, speed_m_s, sd=self.time_sd_s, **near, **powers, larger=larger)

    def _strength_db(self, away_m: float) -> float:
        return self.source_db - 20.0 * log10(max(away_m, NEAREST_M))

    # --- in nodes ---

    def simulate(self, scene: Scene, t_ns: int, place: Point, normals: tuple[float, ...]) -> Numbers | None:
        """See ``Sensing``: the pass that a sensor knows of now, of several the nearest."""
        passes = [one for each in scene.alone() if (one := self._passing(each, t_ns - KNOWN_NS, place)) is not None]
        if not passes:
            return None
        away_m, speed_m_s = min(passes)
        time_sd_s = self.time_sd(away_m, speed_m_s)
        time_s = -KNOWN_NS / _NS + time_sd_s * normals[0]
        strength_db = self._strength_db(away_m) + self._strength_sd_db * normals[1]
        width_s = away_m / max(speed_m_s, SLOWEST_M_S) * (1.0 + WIDTH_SD * normals[2])
        return (time_s, strength_db, width_s, *((time_sd_s, self._strength_sd_db) if self.variances else ()))

    def _passing(self, one: Scene, heard_ns: int, place: Point) -> tuple[float, float] | None:
        """How far away (m) and how fast (m/s) the only target of a scene was when what is heard left it, if it passed.

        It did if it was nearer than just before and just after, and not too slow for that to be noticed.
        """
        heard = one.retarded(heard_ns, place, self.sound_m_s) if self.sound_m_s else one.at(heard_ns)
        if not heard:
            return None
        (x, y, vx, vy), *_ = heard
        away_m = dist((x, y), place)
        left_ns = heard_ns - self._delay_ns(away_m)
        beside = [state for by in (-BESIDE_NS, BESIDE_NS) for state in one.at(left_ns + by)]
        passes = len(beside) == 2 and all(dist(state[:2], place) > away_m for state in beside)
        noticed = away_m <= self.range_m and _narrow(away_m, hypot(vx, vy))
        return (away_m, hypot(vx, vy)) if passes and noticed else None

    def _delay_ns(self, away_m: float) -> int:
        return round(away_m / self.sound_m_s * _NS) if self.sound_m_s else 0

    def event(self, scene: Scene, window: Window, place: Point) -> Iterator[int]:
        """See ``Full``: once the sound of a closest approach has arrived, and the sensor knows that it was loudest.

        Of a ``waveform`` it is a forecast: a detector may take longer, or miss the pass.
        """
        for one in scene.alone():
            for at in closest(one, window, place, self.range_m):
                ((x, y, vx, vy),) = one.at(at)
                away_m = dist((x, y), place)
                known = at + self._delay_ns(away_m) + KNOWN_NS
                if known <= window[1] and _narrow(away_m, hypot(vx, vy)):
                    yield known

    def possible(self, values: Numbers) -> bool:
        """See ``Full``: not so long ago that a report cannot say when."""
        return values[0] > -MOST_EARLY_S

    def reading(self, values: Numbers) -> Passed:
        """See ``Full``: limited to what a report holds."""
        lows = (-MOST_EARLY_S, WEAKEST_DB, 0.0, 0.0, 0.0)
        highs = (0.0, STRONGEST_DB, WIDEST_S, MOST_EARLY_S, LEAST_SURE_DB)
        return Passed(tuple(min(max(value, low), high) for value, low, high in zip(values, lows, highs, strict=False)))

    def invented(self, fault: str, threshold: float, uniform: Uniform) -> Numbers:
        """See ``Full``: the pass of a target at 13.4 m/s, anywhere within range."""
        away_m = self.range_m * sqrt(uniform("distance"))
        sds = (self.time_sd(away_m, USUAL_M_S), self._strength_sd_db) if self.variances else ()
        return (-KNOWN_NS / _NS, self._strength_db(away_m), away_m / USUAL_M_S, *sds)

    def values(self, message: Any) -> Numbers:
        """See ``Full``: the time is relative to the instant of the report's step."""
        sds = (message.time_sd_s, message.strength_sd_db) if self.variances else ()
        return (-message.early_s, message.strength_db, message.width_s, *sds)

    def words(self, message: Any) -> str:
        """See ``Full``."""
        return f"loudest {message.early_s:.4g} s before, {message.strength_db:.4g} dB, {message.width_s:.3g} s wide"

    def longest(self) -> Any:
        """See ``Full``."""
        said = (65535, MOST_EARLY_S, EVENTS - 1, STRONGEST_DB, WIDEST_S)
        return CpaReportSds(*said, MOST_EARLY_S, LEAST_SURE_DB) if self.variances else CpaReport(*said)

    # --- where they are used ---

    def h(self, x: Array, at: Array) -> Array:
        """See ``Sensing``: times (s) relative to the state's instant, and strengths (dB) if they are used."""
        import numpy as np

        from trackfield.models import passing

        times = passing.times(x, at, self.speed_m_s)
        if not self.use_strength:
            return times[..., None]
        away = np.maximum(passing.distances(x, at), NEAREST_M)
        level = x[..., None, 4] if self.unknowns else self.source_db
        found: Array = np.stack((times, level - DB * np.log(away)), axis=-1)
        return found

    def jacobian(self, x: Array, at: Array) -> Array:
        """See ``Sensing``."""
        import numpy as np

        from trackfield.models import passing

        times = passing.times_and_slopes(x, at, self.speed_m_s)[1]
        if not self.use_strength:
            return times[..., None, :]
        away, slopes = passing.distances_and_slopes(x, at)
        strengths = np.where(away > NEAREST_M, -DB / np.maximum(away, NEAREST_M), 0.0)[..., None] * slopes
        strengths[..., 4:] = 1.0
        found: Array = np.stack((times, strengths), axis=-2)
        return found

    @property
    def variance(self) -> Callable[[Array, Array], Array] | None:
        """See ``Full``; None if it is the same everywhere."""
        return self._variance if self.distance_power or self.speed_power or self.place_sd_m else None

    def _variance(self, x: Array, at: Array) -> Array:
        """Noise, and what an error of a sensor's place makes of a time (s^2) and a strength (dB^2)."""
        import numpy as np

        from trackfield.models import passing

        away = passing.distances(x, at)
        speed = np.maximum(np.hypot(x[..., 2], x[..., 3]), SLOWEST_M_S)[..., None]
        sd = self.time_sd(away, speed, larger=np.maximum)
        time = sd**2 + (self.place_sd_m / speed) ** 2
        if not self.use_strength:
            return time[..., None]
        strength = self._strength_sd_db**2 + (DB * self.place_sd_m / np.maximum(away, NEAREST_M)) ** 2
        found: Array = np.stack((time, strength), axis=-1)
        return found

    def loudness(self, z: Array) -> Array:
        """See ``Full``."""
        return z[..., 1]

    def log_clutter(self, z: Array, at: Array) -> Array:
        """See ``Full``: any time that a report holds, and any strength within range, is as likely."""
        import numpy as np

        span_db = self._strength_db(NEAREST_M) - self._strength_db(max(self.range_m, 2.0 * NEAREST_M))
        return np.full(len(z), -log(MOST_EARLY_S) - (log(span_db) if self.use_strength else 0.0))

    def drawn(self, values: Numbers) -> float:
        """See ``Full``: its strength above that at the end of its range, in dB, as a share of the strongest."""
        weakest, strongest = self._strength_db(max(self.range_m, 2.0 * NEAREST_M)), self._strength_db(NEAREST_M)
        return min(max((values[1] - weakest) / (strongest - weakest), 0.0), 1.0)


def _narrow(away_m: float, speed_m_s: float) -> bool:
    """Whether the pulse of a target that passes so far away and so fast is short enough to be noticed."""
    return away_m <= LONGEST_S * speed_m_s
