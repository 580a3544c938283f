"""The study of Zhou et al. (2011) through roles and messages: figures of whole runs, and what is said of them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, replace
from functools import cache
from math import hypot, nan
from statistics import NormalDist
from typing import Any

import numpy as np
import pytest

from launcher.plan.plan import make_plan
from launcher.record.tables import TrackRow
from launcher.reproduce.kernels.study import Figures, Found
from launcher.reproduce.papers.zhou import KERNELS, roles, whole_claims, whole_tables
from launcher.reproduce.papers.zhou.outlying import Outlying
from launcher.reproduce.papers.zhou.roles import FIRST, IDLE, PRODUCT, READINGS, ROLES, WHOLE
from launcher.reproduce.papers.zhou.setups import SETUPS, WALK, WITHIN
from launcher.reproduce.papers.zhou.tables import bound
from launcher.reproduce.papers.zhou.whole import BASE, SCALARS, _informations
from launcher.reproduce.tables import UNKNOWN
from trackfield.filters.types import Array
from trackfield.role import NS, TrackPoint
from trackfield.scenario import Scenario

# --- whole runs -------------------------------------------------------------------------------------------------------


@cache
def short(name: str, steps: int = 5, smooth: bool | None = None) -> Figures:
    """An experiment with few steps, of one run."""
    whole = WHOLE[f"{name}{ROLES}"]
    changes = whole.changes if smooth is None else {**whole.changes, "fusion.smooth_rts": smooth}
    return replace(whole, setup=replace(whole.setup, steps=steps), changes=changes).experiment.run([1])


def test_a_run_has_the_figures_that_tables_need() -> None:
    found = short("walk")
    trackers = WHOLE[f"walk{ROLES}"].trackers
    assert {name for name in found if name.startswith("errors")} == {f"errors {name}" for name in trackers}
    assert {f"{BASE}errors {name}{more}" for name in trackers for more in ("", "+rts")} <= set(found)
    assert all(found[name].shape == (1,) for name in SCALARS)
    assert np.isfinite(found[f"{BASE}errors ukf+rts"][0, 1:-1]).all()
    assert found["information"].shape == (1, 5, 4, 4)
    # one election, in which nobody measured at the first step; from then on there are reports
    assert [found[name][0] for name in ("elections", "split elections")] == [1.0, 0.0]
    assert not found["information"][0, 0].any() and all(found["information"][0, step].any() for step in (2, 3, 4))
    assert np.isfinite(found[f"errors {FIRST}"][0, 1:]).all()
    assert 0.0 < found["awake"][0] < found["most awake"][0] <= 1.0


def test_a_smoother_at_the_base_costs_no_byte() -> None:
    with_it, without = short("walk"), short("walk", smooth=False)
    for name in ("frames", "bytes", "handovers", "awake"):
        assert with_it[name][0] == without[name][0]
    assert np.array_equal(with_it["errors ukf"], without["errors ukf"])


@pytest.mark.parametrize("name", [PRODUCT, "outliers", "rss 4 dB", "paperlike"])
def test_the_other_experiments_track_too(name: str) -> None:
    found, whole = short(name, 4), WHOLE[f"{name}{ROLES}"]
    for tracker in whole.trackers:
        away = np.linalg.norm(found[f"errors {tracker}"][0, 1:, :2], axis=-1)
        assert (away < whole.setup.sense_m).all()


def test_without_a_target_nobody_elects_and_nobody_is_told_anything() -> None:
    found = short(IDLE)
    assert [found[name][0] for name in ("elections", "frames", "handovers")] == [0.0, 0.0, 0.0]
    assert np.isnan(found[f"errors {FIRST}"]).all()
    assert found["awake"] < 0.5 * short(READINGS)["awake"]


def test_the_information_is_that_of_the_sensors_behind_a_point() -> None:
    plan = make_plan(Scenario.load("zhou-upf", {"target.steps": 3}), run="information")
    sensors = [place for place in plan.info.places if place.role == "peer"][:3]
    at_ns = plan.origin_ns + 2 * plan.step_ns
    point = TrackPoint(
        "gpf-ukf", "target", at_ns, "tracking", (0.0,) * 4, (1.0,) * 16, tuple(one.id for one in sensors)
    )
    (path,) = plan.paths.values()
    state = path.at(at_ns / NS)
    assert state is not None
    x, y = state[:2]
    expected = np.zeros((4, 4))
    for one in sensors:
        away = hypot(x - one.x, y - one.y)
        slope = np.array([(x - one.x) / away, (y - one.y) / away, 0.0, 0.0])
        expected += np.outer(slope, slope) / WALK.noise**2
    found = _informations(plan, replace(WALK, steps=3), [TrackRow(at_ns, point)])
    assert found[1] == pytest.approx(expected)
    assert not found[0].any() and not found[2].any()


def test_one_normal_draw_gives_noise_and_outliers() -> None:
    """Over an even grid of its values, so without chance."""
    kind = Outlying(range_m=20.0, outliers=0.1, up_to_m=20.0)
    n = 200_000
    draws = np.array([kind.split(NormalDist().inv_cdf((i + 0.5) / n)) for i in range(n)])
    noise, longer = draws.T
    out = longer > 0.0
    assert out.mean() == pytest.approx(0.1, abs=1e-4)
    assert longer[out].mean() == pytest.approx(10.0, abs=0.01)
    assert np.histogram(longer[out], 4, (0.0, 20.0))[0] == pytest.approx(n * 0.1 / 4, rel=0.01)
    for some, rel in ((noise[~out], 0.01), (noise[out], 0.05)):
        assert some.mean() == pytest.approx(0.0, abs=0.05)
        assert some.std() == pytest.approx(1.0, rel=rel)
    assert abs(np.corrcoef(noise[out], longer[out])[0, 1]) < 0.05


def test_an_outlying_sensor_is_one_that_measures_distances() -> None:
    class Target:
        def at(self, t_ns: int) -> list[tuple[float, float, float, float]]:
            return [(3.0, 4.0, 0.0, 0.0)]

    kind = Outlying(range_m=20.0, floor_sd_m=1.0, growth_m=0.0, outliers=0.1)
    plain, outlier = NormalDist().inv_cdf(0.55), NormalDist().inv_cdf(0.05)
    assert kind.simulate(Target(), 0, (0.0, 0.0), (plain,)) == pytest.approx((5.0,))  # type: ignore[arg-type]
    (reading,) = kind.simulate(Target(), 0, (0.0, 0.0), (outlier,)) or ()  # type: ignore[arg-type]
    assert reading - kind.split(outlier)[0] == pytest.approx(5.0 + 10.0, abs=0.001)
    assert kind.simulate(Target(), 0, (50.0, 0.0), (plain,)) is None  # type: ignore[arg-type]


# --- what is said -----------------------------------------------------------------------------------------------------

RUNS = 120


def invented(errors: Mapping[str, float], **scalars: float) -> Found:
    """Runs of all experiments, with errors of this rms (in units of the bound's scale) by "CASE TRACKER" or tracker."""
    rng = np.random.default_rng(1)
    figures = {}
    for case, whole in WHOLE.items():
        kind, steps = case.removesuffix(ROLES), whole.setup.steps
        scale = least(whole.setup) if whole.bounded else 1.0
        some: dict[str, Array] = {}
        for name in (*whole.trackers, *(f"{one}+rts" for one in whole.trackers)):
            rms = errors.get(f"{kind} {name}", errors.get(name, 1.0))
            one = rng.standard_normal((RUNS, steps, 4)) * rms * scale / np.sqrt(2.0)
            some |= {f"errors {name}": one, f"{BASE}errors {name}": one}
        some["information"] = np.broadcast_to(_INFORMATION / whole.setup.noise**2, (RUNS, steps, 4, 4))
        some |= {name: np.full(RUNS, scalars.get(name.replace(" ", "_"), 1.0)) for name in SCALARS}
        figures[case] = some
    return Found(RUNS, figures)


_INFORMATION = np.diag([1.5, 1.5, 0.0, 0.0])
"""Of three sensors around the target, with noise of one metre."""


def least(setup: Any) -> float:
    figures = {"x": {"information": np.broadcast_to(_INFORMATION / setup.noise**2, (1, setup.steps, 4, 4))}}
    return bound(Found(1, figures), "x", setup)


def verdicts(found: Found) -> dict[str, str]:
    return {claim.name: claim.verdict for claim in whole_claims.claims(found)}


def test_verdicts_follow_the_figures() -> None:
    good = verdicts(
        invented(
            {"bootstrap-100": 6.0, "upf-paper": 1.1, "ukf+rts": 0.5, "ukf": 1.0},
            awake=0.1,
            split_elections=0.0,
            elections=1.0,
        )
    )
    assert set(good.values()) == {"holds"}
    bad = verdicts(
        invented(
            {
                "gpf-ukf": 70.0, "local, product gpf-ukf": 100.0, "local, intersection gpf-ukf": 100.0,
                "hand-over of mean and covariance upf": 2.0, "ukf+rts": 0.8,
            },
            awake=0.6, split_elections=1.0, elections=1.0,
        )
    )  # fmt: skip
    kept = [name for name in bad if "stably" in name]
    assert {verdict for name, verdict in bad.items() if name not in kept} == {"does not hold"}
    assert bad[kept[0]] == "does not hold"


def test_a_claim_holds_in_part_if_one_way_of_combining_is_as_good() -> None:
    found = verdicts(invented({f"{PRODUCT} gpf-ukf": 3.0}))
    assert [found[name] for name in found if name.startswith("Child nodes")] == ["holds in part"]


def test_two_runs_are_too_few_to_tell_whether_any_is_lost() -> None:
    found = invented({})
    few = Found(2, {case: {name: value[:2] for name, value in some.items()} for case, some in found.figures.items()})
    assert [claim.verdict for claim in whole_claims.claims(few) if "stably" in claim.name] == [UNKNOWN]


def test_a_run_without_a_track_at_its_end_is_lost() -> None:
    found, case = invented({}), f"walk{ROLES}"
    errors = found.figures[case][f"errors {FIRST}"] = found.figures[case][f"errors {FIRST}"].copy()  # type: ignore[index]
    assert whole_tables.lost(found, case, FIRST).value == 0.0
    errors[:30, -1] = nan
    errors[30:60, -WITHIN - 1] = 1e3  # before the steps that count
    assert whole_tables.lost(found, case, FIRST).value == pytest.approx(30 / RUNS)


def test_tables_leave_out_what_there_is_not() -> None:
    found = invented({})
    figures = {case: dict(some) for case, some in found.figures.items()}
    figures[f"paperlike{ROLES}"][f"{BASE}errors {FIRST}"] = np.full((RUNS, 50, 4), nan)
    figures[f"{IDLE}{ROLES}"]["reports"] = np.full(RUNS, nan)
    tables = whole_tables.tables(Found(RUNS, figures))
    json.dumps({name: [asdict(row) for row in rows] for name, rows in tables.items()}, allow_nan=False)
    far = [row.quantity for row in tables["roles, base"] if row.case == "paperlike"]
    assert far == [whole_tables.IN_NETWORK, "share of steps with a track at the base"]
    assert not [row for row in tables["roles, network"] if (row.case, row.quantity) == (IDLE, "reports")]
    assert len(whole_tables.parts(Found(RUNS, figures))) == len(tables)


def test_bare_filters_alone_have_none_of_it() -> None:
    assert whole_tables.tables(Found(2, {})) == {}
    assert whole_claims.claims(Found(2, {})) == []
    bare = KERNELS.experiments_of(roles=False)
    assert not set(bare) & set(roles.EXPERIMENTS)
    assert set(SETUPS) <= set(bare)
    assert set(KERNELS.experiments_of(roles=True)) == {*bare, *WHOLE}
