"""The batched kernels of Özfidan et al. (2018) beside masters and slaves that exchange messages, on ideal links."""

from __future__ import annotations

from functools import cache, partial

import numpy as np
import pytest

from launcher.plan.plan import make_plan
from launcher.record.ledger import Ledger
from launcher.record.tables import TrackRow
from launcher.record.virtually import simulate
from launcher.records import Plan
from launcher.reproduce.kernels.study import Found
from launcher.reproduce.papers.ozfidan import roles, scheduling
from launcher.reproduce.papers.ozfidan.field import NOBODY, Truth, associated
from launcher.reproduce.papers.ozfidan.scheduling import Scene
from launcher.reproduce.papers.ozfidan.tracks import _by_ukf, _information
from trackfield.filters.gaussian import constant_velocity, predict
from trackfield.filters.types import Array, Gaussian
from trackfield.scenario import Scenario
from trackfield.sensing.range import Range

STEPS, SIGMA_V, PRIOR_SD = 40, 0.5, (1.0, 1.0, 0.5, 0.5)
KIND = Range(range_m=2000.0, floor_sd_m=0.1, growth_m=0.02)
FIELD = {
    "name": "beside",
    "seed": 3,
    "field": {"layout": "random", "nodes": 40, "spacing_m": 100.0},
    "sensor": {"kind": "range", "range_m": KIND.range_m, "floor_sd_m": KIND.floor_sd_m, "growth_m": KIND.growth_m},
    "target": {"path": "drifting", "q": 0.25, "speed_m_s": 12.0, "start_m": [300.0, 300.0], "half_width_m": 280.0},
    "link": {"model": "ideal"},
    "fusion": {
        "trackers": ["ukf"], "prior": "paper", "prior_sd": list(PRIOR_SD), "sigma_v": SIGMA_V, "deadline_s": 0.4,
    },
}  # fmt: skip


@cache
def ran(policy: str, capacity: int) -> tuple[Plan, Ledger, list[TrackRow]]:
    architecture = {"kind": "clusters", "masters": 12, "placement": "random", "capacity": capacity, "policy": policy}
    scenario = Scenario.load({**FIELD, "target": {**FIELD["target"], "steps": STEPS}, "architecture": architecture})
    plan = make_plan(scenario, run="beside")
    return plan, *simulate(plan)


def places(plan: Plan, role: str) -> Array:
    return np.array([(one.x, one.y) for one in plan.info.places if one.role == role])


def truth_of(plan: Plan, capacity: int) -> Truth:
    """The field of the run, as the kernels have it; there are no paths in it."""
    masters, slaves = places(plan, "master"), places(plan, "slave")
    prior = plan.tracking["prior"]
    belief = Gaussian(np.array([prior["mean"]]), np.diag(np.square(prior["sd"]))[None])
    owner = associated(masters, slaves, capacity)
    return Truth(masters[None], slaves[None], owner[None], np.empty(0), np.empty(0), belief)


@pytest.mark.parametrize("policy", ["closest", "merge_until_3", "nearest_4", "information_2", "trace"])
@pytest.mark.parametrize("capacity", [3, 5])
def test_roles_choose_and_estimate_as_the_kernels_do(policy: str, capacity: int) -> None:
    """From what a leader knew at a step, the kernels choose who reported at the next, and estimate what it did then."""
    plan, ledger, rows = ran(policy, capacity)
    slaves = [one.id for one in plan.info.places if one.role == "slave"]
    read = {(row.src, row.step): row.values[0] for row in ledger.rows if row.kind == "range"}
    truth, moves = truth_of(plan, capacity), constant_velocity(1.0, SIGMA_V)
    follow = _by_ukf(truth, moves, KIND, [0])
    belief, leaders = truth.prior, list[str]()
    leader = np.hypot(*(truth.masters[0] - belief.mean[0, :2]).T).argmin()[None]
    points = {row.point.step: row for row in rows if row.point.source != "base"}
    assert sorted(points) == list(range(1, STEPS + 1))
    for step in range(1, STEPS + 1):
        point = points[step].point
        ahead = predict(belief, moves)
        scene = Scene(truth, belief.mean, ahead, leader, partial(_information, KIND, truth.slaves))
        chosen = scheduling.POLICIES[policy](scene)
        wanted = [number for number in chosen.slaves[0] if number != NOBODY]
        assert set(point.sensors) == {slaves[number] for number in wanted}, step
        z = np.array([[read[slaves[number], step] for number in wanted]]).reshape(1, -1)
        at = truth.slaves[:, wanted] if wanted else np.zeros((1, 0, 2))
        belief, leader = follow(z, at, np.ones_like(z)), chosen.leader
        assert point.mean == pytest.approx(tuple(belief.mean[0]), abs=0.05)
        leaders.append(point.source)
    assert len(set(leaders)) > 1


def test_whole_runs_have_a_table_and_claims_beside_those_of_bare_filters() -> None:
    short = roles.run({"target.steps": 4}, (1,))
    assert set(short) == {*roles.COLUMNS, "far"}
    assert all(values.shape == (1,) and np.isfinite(values).all() for values in short.values())
    assert short["orphans"][0] / roles.SLAVES < roles.FEW_ORPHANS
    found = Found(3, {name: {what: np.repeat(values, 3) for what, values in short.items()} for name in roles.RUNS})
    assert roles.done(found)
    assert len(roles.table(found).splitlines()) == 2 + len(roles.RUNS)
    assert [claim.verdict for claim in roles.claims(found)][1] == "holds"
    bad = {roles.FIELD: {**found.figures[roles.FIELD], "to bound": np.full(3, 1.5)}}
    assert roles.claims(Found(3, {**found.figures, **bad}))[0].verdict == "does not hold"
    assert not roles.done(Found(3, {}))
    assert roles.claims(Found(3, {})) == []
