"""The camera in whole runs of ``yang-ecpa``: from sound through radio, head, gateway and control to its picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from math import atan2, cos, degrees, hypot, nan, radians, sin
from typing import Any, Final

import numpy as np

from launcher.outside import Aim
from launcher.plan.plan import make_plan
from launcher.record.figures.camera.judged import Judge, Shot
from launcher.record.ledger import Ledger
from launcher.record.outside.told import outside_of
from launcher.reproduce.kernels.study import Experiment, Figures, Found
from launcher.reproduce.papers.yang.camera.aimed import ACROSS, FAR, FAST, LINES, NEAR, NOWHERE, VIEWS, Line
from launcher.reproduce.papers.yang.trials.field import SPEED
from launcher.reproduce.papers.yang.whole.runs import SCENARIO, Pass, passes_of
from trackfield.drivers.virtual import Virtual
from trackfield.filters.types import Array
from trackfield.role import NS
from trackfield.scenario import Scenario

MOST: Final = 100
"""Runs of each with one pass; one takes half a second of processor time."""
MOST_FAST: Final = 40
"""The same of fast targets."""
MOST_FOUR: Final = 25
"""The same with the four passes of the packaged scenario."""
FIGURES: Final = ("seen", "filmed", "delay", "after", "off")
HALF_S: Final = 10.0
"""A pass begins so long before the target is in the middle, and ends so long after it."""
RUN: Final = "camera, roles: "
PACKAGED: Final = f"{RUN}as packaged"
WITH: Final = f"{RUN}A to C, with prediction"
WITHOUT: Final = f"{RUN}A to C, without"
FASTER: Final = f"{RUN}A to C, 30 m/s"
FASTER_ACROSS: Final = f"{RUN}A to C, 30 m/s, north"
FASTER_FAR: Final = f"{RUN}A to C, 30 m/s, from {FAR}"
HOPS: Final = f"{RUN}A to C, three hops"
TWICE: Final = f"{RUN}A to C, three hops, twice their delay"
ALL_FAR: Final = f"{RUN}as packaged, from {FAR}"
HOP_S: Final = 0.02
"""What a hop takes to hand on, as in the scenario."""
_BEST: Final[Mapping[str, Any]] = {"sensor.detector": "fit", "sensor.variances": True, "fusion.trackers": ["ml"]}
_HOPS: Final[Mapping[str, Any]] = {
    "camera.hops": [[60.0, -60.0], [100.0, -60.0], [70.0, -40.0]],
    "backbone.model": "lognormal_prr",
    "backbone.radio": "wifi11b",
    "backbone.extra_loss": 0.1,
}
"""Three nodes more, by the radio of the field, each transmission lost with a probability of 0.1."""


def run(changes: Mapping[str, Any], seeds: Sequence[int]) -> Figures:
    """Figures (R, P) of each of the P passes of a run.

    ``seen``: 1 if the target is in the picture at the instant that the last shot of the pass aims at (``in_frame`` of
    metrics.json), 0 if not, ``NOWHERE`` if there is a fix and no shot, as the camera cannot look there, NaN without a
    fix. ``filmed``: 1 if a frame of the video shows the target. ``delay`` (s): from the last CPA to when camera control
    has the fix, as it measures that. ``after`` (s): from then until that instant. ``off`` (deg): by how much the camera
    looks past the target then.
    """
    found = [_run(changes, seed) for seed in seeds]
    return {name: np.stack([one[name] for one in found]) for name in found[0]}


def _run(changes: Mapping[str, Any], seed: int) -> dict[str, Array]:
    plan = make_plan(Scenario.load(SCENARIO, {**_BEST, "seed": seed, **changes}), run=f"{SCENARIO}-{seed}")
    ledger = Ledger(plan.run, plan.processes)
    Virtual(plan.run, plan.processes, ledger).run()
    ledger.close()
    outside, wrong = outside_of(plan, ledger.diaries.values())
    if outside is None or wrong:
        raise ValueError(f"nothing can be said of the camera: {wrong}")
    places = np.array([(place.x, place.y) for place in plan.info.places if place.id.startswith("n")])
    shots = Judge(outside, plan.paths, plan.run.end_ns).shots
    rows = [_pass(one, outside.aims, shots) for one in passes_of(plan, places)]
    return {name: np.array([row.get(name, nan) for row in rows]) for name in FIGURES}


def _pass(one: Pass, aims: Sequence[Aim], shots: Sequence[Shot]) -> dict[str, float]:
    """What is known of a pass, by the last CPA of the event that a fix is of."""
    fixes = [aim for aim in aims if one.from_s <= aim.cpa_ns / NS < one.until_s]
    made = [shot for shot in shots if one.from_s <= shot.aim.cpa_ns / NS < one.until_s]
    if not made:
        return {"seen": NOWHERE, "filmed": 0.0, "delay": fixes[-1].delay_s} if fixes else {}
    last = made[-1]
    known = {
        "seen": float(bool(last.in_frame)),
        "filmed": float(any(seen for shot in made for _, seen in shot.frames)),
        "delay": last.aim.delay_s,
        "after": (last.aim.aim_ns - last.aim.t_ns) / NS,
    }
    return known if last.error is None else {**known, "off": hypot(last.error.pan_deg, last.error.tilt_deg)}


def waypoints(line: Line, speed: float) -> list[list[float]]:
    """One pass on a line at this speed (m/s): [s, m east, m north] of its ends."""
    east, north = sin(radians(line.heading_deg)) * speed, cos(radians(line.heading_deg)) * speed
    x, y = line.x_m, line.y_m
    return [[HALF_S + s, x + s * east, y + s * north] for s in (-HALF_S, HALF_S)]


def _one(speed: float = SPEED, **changes: Any) -> Mapping[str, Any]:
    """The scenario with one pass from A to C."""
    line = LINES["A to C"]
    assert line is not None
    return {"target.waypoints": waypoints(line, speed), **changes}


def _from(view: str) -> Mapping[str, Any]:
    """The camera of this name."""
    x, y, heading = VIEWS[view]
    ahead = degrees(atan2(-y, -x)) if heading is None else heading
    return {"camera.x_m": x, "camera.y_m": y, "camera.heading_deg": ahead}


_CHANGES: Final[Mapping[str, tuple[Mapping[str, Any], int]]] = {
    PACKAGED: ({}, MOST_FOUR),
    ALL_FAR: (_from(FAR), MOST_FOUR),
    WITH: (_one(), MOST),
    WITHOUT: (_one(**{"camera.predict": False}), MOST),
    FASTER: (_one(FAST), MOST_FAST),
    FASTER_ACROSS: (_one(FAST, **_from(ACROSS)), MOST_FAST),
    FASTER_FAR: (_one(FAST, **_from(FAR)), MOST_FAST),
    HOPS: (_one(**_HOPS), MOST),
    TWICE: (_one(**_HOPS, **{"camera.hop_s": 2 * HOP_S}), MOST),
}
EXPERIMENTS: Final = {
    name: Experiment(partial(run, changes), batch=1, most=most, roles=True)
    for name, (changes, most) in _CHANGES.items()
}
"""By name. The camera is at (30, -25) and looks at the field, unless the name says otherwise."""
VIEWED: Final = {FASTER_ACROSS: ACROSS, FASTER_FAR: FAR, ALL_FAR: FAR}
"""The cameras of those that have another one than ``NEAR``."""


def view_of(name: str) -> str:
    """The camera of an experiment."""
    return VIEWED.get(name, NEAR)


def done(found: Found) -> bool:
    """Whether these runs are part of a study."""
    return WITH in found.figures
