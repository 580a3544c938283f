"""The experiments on the filters of Yu et al. (2009), and what each leaves of its runs.

All but the crossing have the same targets, fields and readings. ``errors`` (R, T', 2) m are those of the position,
``truth`` (R, T', 2) m where the target was, ``squares`` (R, T') the errors in units of the covariance, squared,
``changes`` (R,) the headers that followed another.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, Final

from launcher.reproduce.kernels.study import Experiment, Figures
from launcher.reproduce.papers.yu.bound import bounds
from launcher.reproduce.papers.yu.crossing import crossings, held
from launcher.reproduce.papers.yu.imm_log import imm_errors
from launcher.reproduce.papers.yu.runs import PLAIN, Case, tracks
from launcher.reproduce.papers.yu.truth import Field, drawn
from trackfield.filters.blackwell import Blackwell
from trackfield.filters.jm_rbpf import JmRbpf
from trackfield.filters.metrics import Lost, nees
from trackfield.filters.mrbpf import Mrbpf
from trackfield.filters.mrbpf_weightmass import MrbpfWeightmass
from trackfield.filters.rbpf import Rbpf

PARTICLES: Final = 500
RULE: Final = Lost(beyond_m=75.0, steps=10, within=None)
"""A run is lost if its error is above 75 m for 10 steps in a row."""
LAG: Final = 5
Q: Final = 0.12
"""m^2/s^3 of the filters; the target's is 0.01."""
SILENT: Final = 3
"""Steps without a reading, after which a filter starts anew."""
CROSSING_RUNS: Final = 60
CROSSING_PARTICLES: Final = (500, 2000)
SENSORS: Final = (4, 6, 8)
WINDOW_S: Final = 1.0

_COMMON: Final[dict[str, Any]] = {"particles": PARTICLES, "q": Q, "silent": SILENT}
_TURNS: Final[dict[str, Any]] = {**_COMMON, "left_deg_s": 45.0, "right_deg_s": 22.5}
JM: Final = JmRbpf(**_TURNS, turn="known")

_FIELDS: Final = {
    "delay, ignored": Field(delay=True),
    "delay, compensated": Field(delay=True, compensate=True),
    "window, ignored": Field(window_s=WINDOW_S),
    "window, compensated": Field(window_s=WINDOW_S, compensate=True),
    "both, ignored": Field(window_s=WINDOW_S, delay=True),
    "both, compensated": Field(window_s=WINDOW_S, delay=True, compensate=True),
}

CASES: Final[dict[str, Case]] = {
    "rbpf": Case(Rbpf(**_COMMON)),
    "rbpf, never anew": Case(Rbpf(particles=PARTICLES, q=Q)),
    "mrbpf": Case(Mrbpf(**_TURNS)),
    "mrbpf, multinomial": Case(Mrbpf(**_TURNS, draw="multinomial")),
    "mrbpf, never anew": Case(Mrbpf(**{**_TURNS, "silent": 0})),
    "mrbpf, gamma: share": Case(Mrbpf(**_TURNS, gamma="share")),
    "mrbpf-weightmass": Case(MrbpfWeightmass(**_TURNS)),
    "mrbpf-weightmass, multinomial": Case(MrbpfWeightmass(**_TURNS, draw="multinomial")),
    "jm-rbpf": Case(JM),
    "jm-rbpf, multinomial": Case(JmRbpf(**_TURNS, turn="known", draw="multinomial")),
    "jm-rbpf, unknown rate": Case(JmRbpf(**_TURNS, turn="unknown")),
    "jm-rbpf, hands over": Case(JM, hands_over=True),
    "bootstrap, modes": Case(JM, draws_velocities=True),
    **{f"jm-rbpf, {n} sensors": Case(JM, sensors=n) for n in SENSORS[1:]},
    **{f"jm-rbpf, lag {LAG}" + (f", {n} sensors" if n > SENSORS[0] else ""): Case(JM, n, LAG) for n in SENSORS},
    **{f"jm-rbpf, {name}": Case(JM, field=field) for name, field in _FIELDS.items()},
}
"""By name; the first word is the filter's."""
IMM: Final = "imm-ukf, log energy"


def followed(case: Case, runs: Sequence[int]) -> Figures:
    """The runs of one filter."""
    found = tracks(case, runs)
    errors = found.means[..., :2] - found.truth[..., :2]
    return {
        "errors": errors,
        "truth": found.truth[..., :2],
        "squares": nees(errors, found.covariances[..., :2, :2]),
        "changes": found.changes,
    }


def by_imm(tracker: Blackwell, runs: Sequence[int]) -> Figures:
    """The runs of the interacting Kalman filters, with the modes and the noise of this tracker."""
    return {"errors": imm_errors(tracker.turns, Q, SENSORS[0], tracker.silent, PLAIN, runs)}


def bounded(runs: Sequence[int]) -> Figures:
    """The bounds (R, T) m, for each number of sensors."""
    told = drawn(PLAIN, runs)
    return {f"{n}": bounds(PLAIN, told, n) for n in SENSORS}


def crossed(particles: int, runs: Sequence[int]) -> Figures:
    """The runs of two targets that cross: ``means`` and ``truth`` (R, 2, T, 2), and who is lost or swapped (R,)."""
    found = crossings(JmRbpf(**{**_TURNS, "particles": particles}, turn="known"), PLAIN, runs)
    lost, swapped = held(found, RULE)
    return {"means": found.means, "truth": found.truth, "lost": lost.astype(float), "swapped": swapped.astype(float)}


def crossing(particles: int) -> str:
    """The name of an experiment with two targets."""
    return f"two targets, {particles} particles"


EXPERIMENTS: Final[dict[str, Experiment]] = {
    **{name: Experiment(partial(followed, case)) for name, case in CASES.items()},
    IMM: Experiment(partial(by_imm, JM)),
    "bound": Experiment(bounded),
    **{crossing(n): Experiment(partial(crossed, n), 10, CROSSING_RUNS) for n in CROSSING_PARTICLES},
}
