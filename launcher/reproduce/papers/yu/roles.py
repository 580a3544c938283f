"""The same study through roles and messages: whole runs in virtual time of the scenario ``yu-mrbpf``.

Each tracker leads a field of its own: who measures follows what it knows. Runs of one number have one field, path and
prior, whatever leads there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, Final

import numpy as np

from launcher.plan.plan import make_plan
from launcher.record.figures.leaders import leaders_metrics
from launcher.record.ledger import Ledger
from launcher.record.tables import TrackRow
from launcher.record.views import headline
from launcher.record.virtually import simulate
from launcher.records import SENSES, Plan
from launcher.reproduce.kernels.study import Experiment, Figures
from launcher.reproduce.papers.yu.bound import bounds
from launcher.reproduce.papers.yu.experiments import LAG, PARTICLES, SENSORS, Q
from launcher.reproduce.papers.yu.runs import PLAIN
from launcher.reproduce.papers.yu.truth import SOUND_M_S, STEPS, Truth
from trackfield.filters.types import Array, Gaussian
from trackfield.role import NS
from trackfield.scenario import Scenario

YU: Final = "yu-mrbpf"
QUICK: Final[Mapping[str, Any]] = {
    "clock.sync": False, "clock.offset_ms": 0.0, "clock.drift_ppm": 0.0, "architecture.announcements": 1,
}  # fmt: skip
"""A short setup: clocks are right, and each node announces itself once. Most of a run's frames are of the setup."""
KINDS: Final = (
    "poll", "energy", "no-target", "result", "hand-over", "hand-over-ack", "claim", "join-claim", "doubt", "alive",
    "dissolve",
)  # fmt: skip
"""What nodes say to each other once the field is set up."""
AMOUNTS: Final = ("frames", "payload", "bytes on air", "air, ms")
COUNTS: Final = ("handovers", "take_overs", "two_leader_steps", "reports_used")
R: Final = "roles: "
"""Names of these experiments begin so."""
BASE: Final = f"{R}jm-rbpf"
AS_IT_IS: Final = f"{R}jm-rbpf, clocks to be set"
SMOOTHED: Final = {"fusion.smooth_lag": LAG}
_TRACKERS: Final = {name: {"fusion.trackers": [name]} for name in ("jm-rbpf", "mrbpf", "rbpf")}
_JM: Final = _TRACKERS["jm-rbpf"]
_SOUND: Final = {"sensor.sound_m_s": SOUND_M_S}
_WINDOW: Final = {"sensor.window_s": 1.0}
_DEAF: Final = {"sensor.compensate_delay": False, "sensor.compensate_window": False}
_BOOTSTRAP: Final = {
    "fusion.trackers": ["bootstrap"], "fusion.sigma_v": Q**0.5,
    "fusion.options": {"bootstrap": {"n": PARTICLES, "keeps": "particles"}},
}  # fmt: skip
"""The only one of these trackers whose belief is its particles; it knows no turns."""
SOUND: Final = {
    f"{R}jm-rbpf, delay, ignored": {**_SOUND, **_DEAF},
    f"{R}jm-rbpf, window, ignored": {**_WINDOW, **_DEAF},
    f"{R}jm-rbpf, both, ignored": {**_SOUND, **_WINDOW, **_DEAF},
    f"{R}jm-rbpf, both, compensated": {**_SOUND, **_WINDOW},
}
FORMS: Final = ("gaussian", "particles")
NEVER_ANEW: Final = f"{R}rbpf, never anew"
NEAREST: Final = f"{R}jm-rbpf, always the nearest leads"
RUNS: Final[dict[str, dict[str, Any]]] = {
    BASE: {**_JM, **SMOOTHED, **QUICK},
    f"{R}mrbpf": {**_TRACKERS["mrbpf"], **QUICK},
    f"{R}rbpf": {**_TRACKERS["rbpf"], **QUICK},
    NEVER_ANEW: {
        **_TRACKERS["rbpf"], **QUICK, "fusion.options.rbpf.silent": 0, "architecture.silent_steps": 1000,
    },
    **{
        f"{R}jm-rbpf, {n} sensors": {**_JM, **SMOOTHED, **QUICK, "architecture.sensors": n} for n in SENSORS[1:]
    },
    NEAREST: {**_JM, **QUICK, "architecture.sticky": False},
    f"{R}jm-rbpf, hands over: gaussian": {**_JM, **QUICK, "architecture.handover": "gaussian"},
    **{f"{R}bootstrap, hands over: {form}": {**_BOOTSTRAP, **QUICK, "architecture.handover": form} for form in FORMS},
    **{name: {**_JM, **QUICK, **changes} for name, changes in SOUND.items()},
    AS_IT_IS: dict(_JM),
}  # fmt: skip
"""The runs by name, with what they change of the scenario."""
MOST: Final = 100
FEW: Final = 1
"""Runs of the field as it is packaged, in which three quarters of the time goes to the setting of clocks."""


def run(changes: Mapping[str, Any], seeds: Sequence[int]) -> Figures:
    """The figures of whole runs.

    ``errors`` (R, T, 2) m are those of the live track, ``smoothed`` those of the track ``LAG`` steps later; NaN where
    there is none. ``truth`` (R, T, 2) m is where the target was, ``bound`` (R, T) m. Each of ``AMOUNTS`` is (R,
    KINDS), of all frames after the setup; each of ``COUNTS`` is (R,).
    """
    each = [_figures(changes, seed) for seed in seeds]
    return {name: np.stack([one[name] for one in each]) for name in each[0]}


def _figures(changes: Mapping[str, Any], seed: int) -> dict[str, Array]:
    plan = make_plan(Scenario.load(YU, {"seed": seed, **changes}), run=f"{YU}-{seed}")
    return figures_of(plan, *simulate(plan))


def figures_of(plan: Plan, ledger: Ledger, rows: Sequence[TrackRow]) -> dict[str, Array]:
    """Those of one run, without R; see ``run``."""
    path, shown = path_of(plan), headline(plan, rows)
    leaders = leaders_metrics(plan, ledger.rows, rows)
    return {
        "errors": _errors(plan, shown, path, smoothed=False),
        "smoothed": _errors(plan, shown, path, smoothed=True),
        "truth": path[1:, :2],
        "bound": _bound(plan, path),
        **traffic(plan, ledger),
        **{name: np.array(float(leaders[name] or 0.0)) for name in COUNTS},
    }


def places_of(seed: int) -> Array:
    """Where the sensors of a run are, (S, 2) m."""
    plan = make_plan(Scenario.load(YU, {"seed": seed, **_JM, **QUICK}), run=f"{YU}-{seed}")
    return np.array([(place.x, place.y) for place in plan.info.tagged(SENSES)])


def path_of(plan: Plan) -> Array:
    """Where the target is at each step, from 0 on: (T + 1, 4)."""
    (path,) = plan.paths.values()
    steps = plan.step_of(plan.run.end_ns - 1)
    states = [path.at((plan.origin_ns + step * plan.step_ns) / NS) for step in range(min(steps, STEPS) + 1)]
    return np.array(states, float)


def _errors(plan: Plan, rows: Sequence[TrackRow], path: Array, *, smoothed: bool) -> Array:
    """(T, 2) m, NaN where nothing was published."""
    found = np.full((len(path) - 1, 2), np.nan)
    for row in rows:
        step = plan.step_of(row.t_ns)
        if bool(row.point.lag) is smoothed and row.has_track and 0 < step < len(path):
            found[step - 1] = np.array(row.point.mean[:2]) - path[step, :2]
    return found


def _bound(plan: Plan, path: Array) -> Array:
    """(T,) m, of the nearest four sensors: that of the bare filters, in this field; NaN in a run of another length."""
    if len(path) != STEPS + 1:
        return np.full(len(path) - 1, np.nan)
    places = np.array([(place.x, place.y) for place in plan.info.tagged(SENSES)])
    told = Truth(places[None], path[None], np.empty(0), Gaussian(np.empty(0), np.empty(0)))
    found: Array = bounds(PLAIN, told, SENSORS[0])[0]
    return found


def traffic(plan: Plan, ledger: Ledger) -> dict[str, Array]:
    """What was sent from a step before the first one on, (KINDS,) each: with all attempts and acknowledgements."""
    found = np.zeros((len(AMOUNTS), len(KINDS)))
    for frame in ledger.aired:
        if frame.kind in KINDS and frame.sent_ns >= plan.origin_ns - plan.step_ns:
            cost = ledger.link.fate(frame)
            air_ns, size = cost.air_ns + cost.ack_air_ns, cost.bytes_on_air + cost.ack_bytes
            found[:, KINDS.index(frame.kind)] += (1.0, frame.size, size, 1e-6 * air_ns)
    return dict(zip(AMOUNTS, found, strict=True))


EXPERIMENTS: Final = {
    name: Experiment(partial(run, changes), batch=1, most=FEW if name == AS_IT_IS else MOST, roles=True)
    for name, changes in RUNS.items()
}
