"""What the target of Yu et al. (2009) does, and what the field reads: drawn for each run by its number.

The paper gives the start, the turns' rates and alpha; the rest is set here (docs/papers.md). Every draw is keyed by
run and purpose, so more runs extend fewer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import log, radians
from typing import Final, NamedTuple

import numpy as np

from trackfield.filters.rng import generator
from trackfield.filters.turning import turned
from trackfield.filters.types import Array, Gaussian, Model
from trackfield.sensing.complete import Kind
from trackfield.sensing.energy import Energy

SIZE_M: Final = 1000.0
SENSORS: Final = 200
STEPS: Final = 100
T: Final = 1.0
START: Final = (550.0, 100.0, 5.0, 5.0)
NOISE: Final = 0.01
"""m^2/s^3, the density of the acceleration's noise."""
TURNS: Final = ((30, 32, 45.0), (65, 69, -22.5))
"""First and last second, deg/s."""
PRIOR_SD: Final = (5.0, 5.0, 0.7, 0.7, 0.1)
SOUND_M_S: Final = 343.0
_ITERATIONS: Final = 6
"""Of the time that sound takes: each is nearer by the target's speed over that of sound, a factor of 50."""


@dataclass(frozen=True)
class Field:
    """How energy is read: over ``window_s`` before an instant, and at once or with ``delay``.

    Filters allow for both if they ``compensate``.
    """

    window_s: float = 0.0
    delay: bool = False
    compensate: bool = False

    @property
    def kind(self) -> Energy:
        """The kind of sensing, with the parameters of the study, which are the kind's defaults."""
        sound = SOUND_M_S if self.delay else 0.0
        return Energy(
            window_s=self.window_s,
            sound_m_s=sound,
            compensate_window=self.compensate,
            compensate_delay=self.compensate,
        )

    @property
    def model(self) -> Model:
        """What filters know of it."""
        return _model(self)


@lru_cache
def _model(field: Field) -> Model:
    return Model({"energy": Kind("energy", field.kind)})


class Truth(NamedTuple):
    """R runs: ``places`` (R, S, 2) of the sensors, ``path`` (R, T + 1, 4), ``readings`` (R, T, S), NaN where none.

    ``prior`` is over (x, y, vx, vy, log of the emitted energy) at the start: (R, 5), and (R, 5, 5).
    """

    places: Array
    path: Array
    readings: Array
    prior: Gaussian


def rates() -> Array:
    """(T,) rad/s, of the turn in each step."""
    found = np.zeros(STEPS)
    for first, last, deg_s in TURNS:
        found[first:last] = radians(deg_s)
    return found


def drawn(field: Field, runs: Sequence[int]) -> Truth:
    """The truth of these runs."""
    rngs = [[generator(run, "yu", what) for what in ("places", "path", "readings", "prior")] for run in runs]
    places = np.stack([one[0].uniform(0.0, SIZE_M, (SENSORS, 2)) for one in rngs])
    path = paths(np.stack([one[1].standard_normal((STEPS, 2, 2)) for one in rngs]))
    noise = np.stack([one[2].standard_normal((STEPS, SENSORS)) for one in rngs])
    off = np.stack([one[3].standard_normal(5) for one in rngs])
    start = np.array([*START, log(field.kind.emitted)])
    prior = Gaussian(start + off * PRIOR_SD, np.broadcast_to(np.diag(np.square(PRIOR_SD)), (len(rngs), 5, 5)))
    return Truth(places, path, _readings(field, path, places, noise), prior)


def paths(normals: Array, q: float = NOISE, start: Sequence[float] = START, turns: Array | None = None) -> Array:
    """Paths (R, T + 1, 4) of normals (R, T, 2, 2) and the rates ``turns`` (T,): the motion of the filters, exactly."""
    a, f = turned(rates() if turns is None else turns, T)
    root = np.linalg.cholesky(q * np.array([[T**3 / 3.0, T**2 / 2.0], [T**2 / 2.0, T]]))
    kicks = np.einsum("ij,rtjk->rtik", root, normals)
    path = np.empty((len(normals), normals.shape[1] + 1, 4))
    path[:, 0] = start
    flow = path.view(complex)
    for t in range(normals.shape[1]):
        z, v = flow[:, t, 0], flow[:, t, 1]
        flow[:, t + 1, 0] = z + a[t] * v + kicks[:, t, 0] @ (1.0, 1j)
        flow[:, t + 1, 1] = f[t] * v + kicks[:, t, 1] @ (1.0, 1j)
    return path


def _readings(field: Field, path: Array, places: Array, normals: Array) -> Array:
    """(R, T, S) as ``Energy.simulate`` makes them; NaN beyond its range."""
    kind = field.kind
    away = np.stack([_distances(path, places, s, SOUND_M_S if field.delay else np.inf) for s, _ in kind.parts])
    shares = [share for _, share in kind.parts]
    received = kind.gain * kind.emitted * np.maximum(away, kind.floor_m) ** -kind.alpha
    received = np.average(received, axis=0, weights=shares)
    readings = received + np.hypot(kind.noise, kind.relative * received) * normals
    return np.where(away.min(axis=0) <= kind.range_m, readings, np.nan)


def _distances(path: Array, places: Array, ago_s: float, speed_m_s: float) -> Array:
    """(R, T, S) m to where the target was when what arrives ``ago_s`` before each step left it."""
    late = np.zeros((len(path), STEPS, places.shape[1]))
    for _ in range(_ITERATIONS if np.isfinite(speed_m_s) else 1):
        apart = _at(path, np.arange(1.0, STEPS + 1)[:, None] - (ago_s + late) / T) - places[:, None]
        away: Array = np.hypot(apart[..., 0], apart[..., 1])
        late = away / speed_m_s
    return away


def _at(path: Array, steps: Array) -> Array:
    """The position (R, T, S, 2) at any times, in steps: cubic between the path's places and velocities (Hermite).

    In a turn of 45 degrees in a step this is less than 9 mm off the arc at 7 m/s; before the start it is straight.
    """
    steps = np.broadcast_to(steps, (len(path), *steps.shape[-2:]))
    first = np.clip(np.floor(steps).astype(int), 0, path.shape[1] - 2)
    s, run = (steps - first)[..., None], np.arange(len(path))[:, None, None]
    here, there = path[run, first], path[run, first + 1]
    begin, end = here[..., :2], there[..., :2]
    between = (1 + 2 * s) * (1 - s) ** 2 * begin + s**2 * (3 - 2 * s) * end
    between += s * (1 - s) ** 2 * T * here[..., 2:] - s**2 * (1 - s) * T * there[..., 2:]
    found: Array = np.where(s < 0.0, begin + s * T * here[..., 2:], between)
    return found
