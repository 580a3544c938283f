"""What sensors spend in a step, with a target and without: the protocol beside a centre to which all report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, Final

import numpy as np

from launcher.plan.plan import make_plan
from launcher.record.figures.energy import batteries_of
from launcher.record.virtually import simulate
from launcher.reproduce.kernels.study import Experiment, Figures
from launcher.reproduce.papers.yu.roles import QUICK, YU, R
from trackfield.filters.types import Array
from trackfield.link.energy import DEVICES
from trackfield.scenario import Scenario

SHORT: Final = 20
LONG: Final = 60
"""Steps of the two runs whose difference counts, so that what the setup takes does not."""
MOST: Final = 1
BATTERY_J: Final = 20000.0
"""Of the packaged scenario: two AA cells."""
DAY_S: Final = 86400.0
OUTSIDE_M: Final = -1500.0
PRESENT: Final = "target"
IDLE: Final = "no target"
TREE: Final = "centre, over a tree"
"""Not run, as a second of it takes seconds: its receivers never sleep, so it takes at least what they draw."""
TREE_W: Final = DEVICES["cc2420-20dbm"].listen_uw * 1e-6
_CLOCK: Final = {name: value for name, value in QUICK.items() if name.startswith("clock.")}
FIELDS: Final[Mapping[str, dict[str, Any]]] = {
    "location-central": {**QUICK},
    "centre, in one hop": {**_CLOCK, "architecture": {"kind": "centralised"}},
}
"""The fields by name, with what they change of the scenario."""


def name_of(field: str, what: str) -> str:
    """The name of an experiment."""
    return f"{R}energy, {field}, {what}"


def spent(changes: Mapping[str, Any], idle: bool, seeds: Sequence[int]) -> Figures:
    """``watts`` (R, S): what each sensor draws after the setup; ``frames`` (R,): all frames in a step."""
    pairs = [[_run(changes, idle, seed, steps) for steps in (SHORT, LONG)] for seed in seeds]
    each = [[after - before for before, after in zip(*pair, strict=True)] for pair in pairs]
    seconds = LONG - SHORT
    return {what: np.stack([one[i] / seconds for one in each]) for i, what in enumerate(("watts", "frames"))}


def _run(changes: Mapping[str, Any], idle: bool, seed: int, steps: int) -> tuple[Array, Array]:
    """J of each sensor, and all frames, of a run of so many steps; if ``idle`` the target comes in the last one."""
    target: dict[str, Any] = {"target.steps": steps}
    if idle:
        ways = [[0.0, OUTSIDE_M, 500.0], [steps - 1.1, OUTSIDE_M, 500.0], [steps - 1.0, 500.0, 500.0]]
        target = {"target": {"path": "waypoints", "waypoints": ways, "steps": steps, "step_s": 1.0}}
    plan = make_plan(
        Scenario.load(YU, {"seed": seed, "fusion.trackers": ["rbpf"], **changes, **target}), run=f"{YU}-{seed}"
    )
    ledger, _ = simulate(plan)
    used = {one.spec.id: sum(one.spent_j.values()) for one in batteries_of(plan, ledger)}
    return np.array([used[id] for id in sorted(used)]), np.array(float(sum(ledger.sent_kinds.values())))


EXPERIMENTS: Final = {
    name_of(field, what): Experiment(partial(spent, changes, what == IDLE), batch=1, most=MOST, roles=True)
    for field, changes in FIELDS.items()
    for what in (PRESENT, IDLE)
}
