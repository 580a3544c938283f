"""The kernels of Yu et al.: the target and what the field reads, runs against each alone, the protocol, who is lost."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
import pytest

from launcher.reproduce.kernels.draws import generators
from launcher.reproduce.kernels.study import Found
from launcher.reproduce.papers import kernels_named
from launcher.reproduce.papers.yu import dimension, truth
from launcher.reproduce.papers.yu.bound import bounds
from launcher.reproduce.papers.yu.crossing import Crossing, crossings, held, nearest
from launcher.reproduce.papers.yu.experiments import CASES, EXPERIMENTS, PLAIN, RULE, followed
from launcher.reproduce.papers.yu.imm_log import imm_errors
from launcher.reproduce.papers.yu.runs import Case, looked_back, reports_of, selected, sticky, tracks
from launcher.reproduce.papers.yu.tables import PERIODS, lost
from launcher.reproduce.papers.yu.truth import Field, drawn, paths
from trackfield.filters.gaussian import Motion
from trackfield.filters.jm_rbpf import JmRbpf
from trackfield.filters.mrbpf import Mrbpf
from trackfield.filters.types import Gaussian, Readings, Reports
from trackfield.models import ranging
from trackfield.tracking.smoothing import Filtered, smoothed

FEW = JmRbpf(60, q=0.12, silent=3, turn="known", left_deg_s=45.0, right_deg_s=22.5)


# --- the truth ---


def test_the_target_turns_as_the_paper_says() -> None:
    """Without noise: 45 deg/s for 2 s to the left, 22.5 deg/s for 4 s to the right."""
    path = paths(np.zeros((1, 100, 2, 2)))[0]
    assert path[30] == pytest.approx([700.0, 250.0, 5.0, 5.0])
    assert path[32, 2:] == pytest.approx([-5.0, 5.0])
    assert path[69, 2:] == pytest.approx([5.0, 5.0])
    radius = np.hypot(5.0, 5.0) / np.radians(45.0)
    chord = path[32, :2] - path[30, :2]
    assert np.hypot(*chord) == pytest.approx(radius * np.sqrt(2.0))
    assert ((path[:, :2] > 0.0) & (path[:, :2] < 1000.0)).all()


def test_its_noise_is_that_of_a_white_acceleration() -> None:
    """Of 4000 draws; an entry of the covariance has an sd of about 2 % of its size."""
    path = paths(np.random.default_rng(1).standard_normal((4000, 1, 2, 2)), q=0.5, turns=np.zeros(1))
    Q = 0.5 * np.kron(np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]]), np.eye(2))
    assert np.cov((path[:, 1] - path[:, 0]).T) == pytest.approx(Q, abs=0.04)


@pytest.mark.parametrize("field", [Field(), Field(delay=True), Field(window_s=1.0), Field(window_s=1.0, delay=True)])
def test_the_field_reads_what_the_kind_simulates(field: Field) -> None:
    """Without noise, against the kind's own simulation of a target at constant speed."""
    start, places = np.array([500.0, 500.0, 7.0, -3.0]), np.array([[520.0, 480.0], [610.0, 560.0], [700.0, 500.0]])

    class Moving:
        def at(self, t_ns: int) -> Sequence[Any]:
            return [(*(start[:2] + start[2:] * t_ns * 1e-9), *start[2:])]

        def retarded(self, t_ns: int, place: Any, speed_m_s: float) -> Sequence[Any]:
            now = np.array(self.at(t_ns)[0])
            late = ranging.delays(now, np.array([place]), speed_m_s)[0]
            return self.at(t_ns - round(late * 1e9))

        def alone(self) -> Any:
            return [self]

    path = paths(np.zeros((1, truth.STEPS, 2, 2)), start=start, turns=np.zeros(truth.STEPS))
    found = truth._readings(field, path, places[None], np.zeros((1, truth.STEPS, 3)))[0]
    for t in (1, 2, 10):
        for i, place in enumerate(places):
            expected = field.kind.simulate(Moving(), t * 10**9, tuple(place), (0.0,))
            told = None if np.isnan(found[t - 1, i]) else (found[t - 1, i],)
            assert told == (None if expected is None else pytest.approx(expected, rel=1e-6))


def test_more_runs_extend_fewer() -> None:
    few, many = drawn(PLAIN, [3]), drawn(PLAIN, [1, 2, 3])
    for one, other in zip((*few[:3], *few.prior), (*many[:3], *many.prior), strict=True):
        assert np.array_equal(one[0], other[2], equal_nan=True)


# --- the runs ---


@pytest.mark.parametrize(
    "case",
    [
        Case(FEW),
        Case(FEW, hands_over=True),
        Case(FEW, 6, 5),
        Case(FEW, draws_velocities=True),
        Case(Mrbpf(60, q=0.12, silent=3)),
        Case(FEW, field=Field(1.0, delay=True, compensate=True)),
    ],
    ids=["plain", "hands over", "lag", "velocities", "twice", "delay"],
)
def test_a_run_is_the_same_whatever_is_beside_it(case: Case) -> None:
    alone, beside = tracks(case, [2]), tracks(case, [1, 2, 3])
    assert beside.means[1] == pytest.approx(alone.means[0], rel=1e-9, abs=1e-9)
    assert beside.covariances[1] == pytest.approx(alone.covariances[0], rel=1e-9, abs=1e-9)
    assert beside.changes[1] == alone.changes[0]


def test_a_run_of_kalman_filters_is_the_same_whatever_is_beside_it() -> None:
    alone, beside = _by_kalman(3, [2]), _by_kalman(3, [1, 2, 3])
    assert beside[1] == pytest.approx(alone[0], rel=1e-9, abs=1e-9)


def test_kalman_filters_start_anew_where_they_lost_the_target() -> None:
    """In run 102 the target leaves the range of all chosen sensors in the first turn; run 1 is never lost."""
    never, anew = (_by_kalman(after, [1, 102])[:, -30:] for after in (10**9, 3))
    far, near = (np.linalg.norm(one, axis=-1).mean(axis=1) for one in (never, anew))
    assert far[1] > 200.0
    assert near[1] < 20.0
    assert far[0] == near[0] < 20.0


def _by_kalman(after: int, runs: Sequence[int]) -> Any:
    return imm_errors(FEW.turns, 0.12, 4, after, PLAIN, runs)


@pytest.mark.parametrize("tracker", [FEW, Mrbpf(60, q=0.12, silent=3)])
def test_a_run_is_the_trackers(tracker: Any) -> None:
    """The same reports, step by step, to the tracker that scenarios name."""
    found, told, model = tracks(Case(tracker), [4]), drawn(PLAIN, [4]), PLAIN.model
    (rng,) = generators([4], "yu", "filter")
    state = tracker.init(Gaussian(told.prior.mean[0], told.prior.covariance[0]), model)
    for t in range(40):
        # the first prediction is of particles that are not drawn yet
        cloud = _lifted(state.cloud) if t else _first(tracker, told, model)
        chosen = selected(cloud, told, t, 4, tracker.silent)
        given = reports_of(told, t, chosen)
        there = ~np.isnan(given.readings[0].values[0, :, 0])
        values = given.readings[0].values[0, there]
        sensors = tuple(f"n{i}" for i in range(int(there.sum())))
        reports = Reports(t + 1, sensors, given.positions[0, there], (Readings("energy", values),))
        state, estimate = tracker.step(state, reports, 1.0, rng)
        assert estimate.mean == pytest.approx(found.means[0, t], rel=1e-9, abs=1e-9)
        assert estimate.covariance == pytest.approx(found.covariances[0, t], rel=1e-9, abs=1e-9)


def _lifted(cloud: Any) -> Any:
    return type(cloud)._make(np.asarray(part)[None] for part in cloud)


def _first(tracker: Any, told: Any, model: Any) -> Any:
    from trackfield.filters.blackwell import one
    from trackfield.filters.rao_blackwell import begin

    (rng,) = generators([4], "yu", "filter")
    start = type(drawing := tracker.start(rng, model))._make(np.asarray(part)[None] for part in drawing)
    return begin(one(told.prior), start, tracker.turns)


def test_looking_back_is_the_smoothing_of_tracks() -> None:
    """``tracking.smoothing``, step by step, with the motion that the tracker itself returns."""
    tracker, lag, steps = FEW, 3, 12
    model, told = PLAIN.model, drawn(PLAIN, [5])
    (rng,) = generators([5], "yu", "filter")
    state = tracker.init(Gaussian(told.prior.mean[0], told.prior.covariance[0]), model)
    window: list[Filtered] = []
    earlier = []
    for t in range(steps):
        near = np.argsort(np.linalg.norm(told.places[0] - told.path[0, t + 1, :2], axis=-1))[None, :4]
        reports = reports_of(told, t, near)
        alone = Reports(t, tuple("abcd"), reports.positions[0], (Readings("energy", reports.readings[0].values[0]),))
        after, estimate = tracker.step(state, alone, 1.0, rng)
        motion = tracker.motion(state, after, 1.0) if t else None
        state, now = after, Filtered(alone, Gaussian(estimate.mean, estimate.covariance), motion)
        window = [*window, now]
        if len(window) > lag:
            earlier.append(smoothed(tuple(window[-lag - 1 :])).estimate)
    means = np.stack([one.belief.mean for one in window])[None]
    covariances = np.stack([one.belief.covariance for one in window])[None]
    F, Q = (np.stack(parts)[None] for parts in zip(*(one.motion for one in window[1:] if one.motion), strict=True))
    found = looked_back(Gaussian(means, covariances), Motion(F, Q), lag)
    assert found.mean[0] == pytest.approx(np.stack([one.mean for one in earlier]))
    assert found.covariance[0] == pytest.approx(np.stack([one.covariance for one in earlier]))


# --- the protocol ---


def test_a_header_stays_as_long_as_it_is_chosen() -> None:
    header = np.array([-1, 7, 7])
    header, changed = sticky(header, np.array([[3, 4], [9, 7], [8, 9]]))
    assert header.tolist() == [3, 7, 8]
    assert changed.tolist() == [False, False, True]


def test_the_nearest_are_chosen_and_the_loudest_where_a_track_starts_anew() -> None:
    told = drawn(PLAIN, [1, 2])
    cloud = _cloud(np.array([[700.0, 250.0], [700.0, 250.0]]), silent=np.array([0, 3]))
    chosen = selected(cloud, told, 29, 4, 3)
    away = np.linalg.norm(told.places[0] - [705.0, 255.0], axis=-1)
    assert chosen[0].tolist() == np.argsort(away)[:4].tolist()
    loud = np.nan_to_num(told.readings[1, 29], nan=-np.inf)
    assert chosen[1].tolist() == np.argsort(-loud)[:4].tolist()


def _cloud(places: Any, silent: Any) -> Any:
    from trackfield.filters.rao_blackwell import Cloud

    points = np.concatenate((places, np.full((2, 2), 5.0), np.full((2, 1), 11.5)), axis=1)[:, None]
    return Cloud(points, np.ones((2, 1)), np.zeros((2, 1), int), np.zeros((2, 1)), np.eye(3)[[0, 0]], silent)


def test_each_of_two_targets_has_its_four_nearest_sensors() -> None:
    places = np.random.default_rng(1).uniform(0.0, 1000.0, (2, 200, 2))
    expected = np.array([[[200.0, 200.0], [800.0, 800.0]], [[500.0, 500.0], [501.0, 500.0]]])
    chosen = nearest(places, expected)
    assert all(len(set(row)) == 8 for row in chosen.tolist())
    each = [np.argsort(np.linalg.norm(places[0] - where, axis=-1))[:4].tolist() for where in expected[0]]
    assert set(chosen[0].tolist()) == {*each[0], *each[1]}


def test_swapped_and_lost_are_told_apart() -> None:
    """One is held, one swapped after they met, one lost."""
    line = np.linspace(0.0, 1000.0, 100)
    up, down = np.stack((line, line), axis=-1), np.stack((line, 1000.0 - line), axis=-1)
    both = np.stack((up, down))
    swapped = both.copy()
    swapped[:, 50:] = both[::-1, 50:]
    astray = both.copy()
    astray[1, 60:75] += 100.0
    found = held(Crossing(np.stack((both, swapped, astray)), np.stack([both] * 3)), RULE)
    assert found.lost.tolist() == [False, False, True]
    assert found.swapped.tolist() == [False, True, False]


# --- what comes out ---


def test_the_bound_falls_with_more_sensors_and_no_filter_is_below_it() -> None:
    """Over 60 runs the error of the best filter, 1.7 times the bound, is well above it."""
    runs = range(1, 61)
    told = drawn(PLAIN, runs)
    four, eight = (np.sqrt(np.square(bounds(PLAIN, told, n)).mean()) for n in (4, 8))
    errors = followed(CASES["jm-rbpf"], runs)["errors"]
    assert eight < four < np.sqrt(np.square(errors).sum(axis=-1).mean()) < 2.0 * four


def test_two_targets_that_cross_are_followed() -> None:
    found = crossings(JmRbpf(1000, q=0.12, turn="known"), PLAIN, [1, 2, 3])
    assert np.median(np.linalg.norm(found.means - found.truth, axis=-1)) < 10.0
    assert not held(found, RULE).lost.any()


@cache
def _study() -> Found:
    """Two runs of each experiment."""
    kernels = kernels_named("yu")
    return Found(2, {name: one.run(one.seeds(2)) for name, one in kernels.experiments_of(roles=False).items()})


@pytest.mark.long
def test_the_study_as_a_whole(tmp_path: Any) -> None:
    kernels, found = kernels_named("yu"), _study()
    assert found.figures.keys() == EXPERIMENTS.keys() | dimension.EXPERIMENTS.keys()
    assert {claim.verdict for claim in kernels.claims(found)} <= {"holds", "does not hold", "too few runs to tell"}
    text = "\n".join(part for _, part in kernels.parts(found))
    assert all(f"| {name} " in text for name in CASES)
    kernels.draw(tmp_path, found)
    bare = {name for name, *_ in kernels.figures if not name.endswith("-roles")}
    assert {file.stem for file in tmp_path.iterdir()} == bare


def test_periods_are_those_of_the_turns() -> None:
    assert PERIODS["in the turns"] == [31, 32, 66, 67, 68, 69]
    assert PERIODS["after"][:3] == [33, 34, 35]
    assert len(PERIODS["before"]) == 20


def test_lost_is_ten_steps_in_a_row() -> None:
    errors = np.zeros((3, 100, 2))
    errors[0, 20:30, 0], errors[1, 20:29, 0], errors[2, 20:40:2, 0] = 76.0, 76.0, 500.0
    assert lost(Found(3, {"x": {"errors": errors}}), "x").value == pytest.approx(1 / 3)
