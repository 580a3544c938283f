"""The field and the batched policies of Özfidan et al. (2018), beside those that a leader uses."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from launcher.reproduce.papers.ozfidan import scaled, scheduling
from launcher.reproduce.papers.ozfidan.field import NOBODY, SPEED, Q, Setup, T, Truth, associated, drawn, motion
from launcher.reproduce.papers.ozfidan.scheduling import Chosen, Scene
from launcher.reproduce.papers.ozfidan.tracks import Waking, _awake, _information, _ranges, followed
from trackfield.filters import ukf
from trackfield.filters.types import Gaussian, Readings, Reports
from trackfield.tracking.selection import POLICIES, Cluster, Grounds, informations

SETUP = Setup(masters=12, slaves=40, half_m=800.0, steps=20)


# --- the field ---


def test_each_slave_has_the_nearest_master_that_has_a_place_left() -> None:
    masters = np.array([[0.0, 0.0], [10.0, 0.0], [50.0, 0.0]])
    slaves = np.array([[1.0, 0.0], [2.0, 0.0], [3.0, 0.0], [40.0, 0.0], [4.0, 0.0], [0.0, 1.0], [9.0, 0.0]])
    assert associated(masters, slaves, 2).tolist() == [0, 0, 1, 2, 1, 2, NOBODY]
    assert associated(masters, slaves, 7).tolist() == [0, 0, 0, 2, 0, 0, 1]


def test_what_is_drawn_is_of_a_run_alone() -> None:
    both, one = drawn(SETUP, (3, 8)), drawn(SETUP, (8,))
    for name in ("masters", "slaves", "owner", "path", "normals"):
        assert np.array_equal(getattr(both, name)[1], getattr(one, name)[0])


def test_the_path_has_the_noise_that_filters_expect_and_stays_inside() -> None:
    truth = drawn(Setup(masters=2, slaves=4, half_m=2000.0, steps=200), range(20))
    assert np.abs(truth.path[..., :2]).max() <= 2000.0
    assert np.hypot(*truth.path[:, 0, 2:].T) == pytest.approx(SPEED)
    kicks = truth.path[:, 1:] - truth.path[:, :-1]
    kicks[..., :2] -= T * truth.path[:, :-1, 2:]
    for axis in (0, 1):
        found = np.cov(kicks[..., [axis, axis + 2]].reshape(-1, 2).T)
        assert found == pytest.approx(Q * np.array([[T**3 / 3, T**2 / 2], [T**2 / 2, T]]), rel=0.1)


# --- the policies ---


def one_by_one(truth: Truth, run: int, scene: Scene) -> Grounds:
    """The grounds of a run, as a leader has them."""
    places = {f"{slave}": (float(x), float(y)) for slave, (x, y) in enumerate(truth.slaves[run])}
    clusters = [
        Cluster(f"{i}", (float(x), float(y)), tuple(f"{s}" for s in np.flatnonzero(truth.owner[run] == i)))
        for i, (x, y) in enumerate(truth.masters[run])
    ]
    leader = "" if scene.leader[run] == NOBODY else f"{scene.leader[run]}"

    def information(ids: list[str], state: np.ndarray) -> np.ndarray:
        at = np.array([places[id] for id in ids])
        reports = Reports(0, tuple(ids), at, (Readings("range", np.zeros((len(ids), 1)), None),), 1, False)
        return informations(SETUP.model, state, reports)

    ahead = Gaussian(scene.ahead.mean[run], scene.ahead.covariance[run])
    return Grounds(clusters, scene.estimate[run], ahead, places, information, leader)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", scheduling.POLICIES)
@pytest.mark.parametrize("capacity", [2, 5])
def test_a_batch_chooses_as_a_leader_does(name: str, capacity: int) -> None:
    setup = Setup(masters=12, slaves=40, half_m=800.0, steps=20, capacity=capacity)
    truth, rng = drawn(setup, range(1, 13)), np.random.default_rng(1)
    mean = np.hstack((rng.uniform(-800, 800, (12, 2)), rng.normal(0, 3, (12, 2))))
    root = rng.normal(0, 1, (12, 4, 4)) * np.array([5.0, 5.0, 1.0, 1.0])[:, None]
    ahead = Gaussian(mean + np.array([1.0, 2.0, 0.0, 0.0]), root @ root.mT + np.eye(4))
    leader = np.concatenate((rng.integers(0, 12, 9), [NOBODY] * 3))
    scene = Scene(truth, mean, ahead, leader, partial(_information, SETUP.kind, truth.slaves))
    chosen = scheduling.POLICIES[name](scene)
    for run in range(12):
        choice = POLICIES[name].choose(one_by_one(truth, run, scene))
        assert choice.leader == f"{chosen.leader[run]}"
        ids = {id for members in choice.sensors.values() for id in members}
        assert ids == {f"{s}" for s in chosen.slaves[run] if s != NOBODY}


# --- the tracks ---


@pytest.mark.parametrize("name", ["ukf", "pf", "scaled"])
def test_a_run_is_the_same_whatever_runs_are_beside_it(name: str) -> None:
    both, one = (followed(SETUP, "merge_until_3", name, runs) for runs in ((1, 2), (2,)))
    assert both.errors[1] == pytest.approx(one.errors[0], abs=1e-6)
    assert both.leader[1].tolist() == one.leader[0].tolist()


def test_the_scaled_update_with_the_house_parameters_is_the_house_update() -> None:
    """alpha 1, beta 0, kappa 1 have the same sigma points and weights."""
    rng = np.random.default_rng(3)
    half = rng.normal(size=(6, 4, 4))
    prior = Gaussian(rng.normal(0, 20, (6, 4)), half @ half.mT + np.eye(4))
    places, sd = rng.uniform(-50, 50, (6, 3, 2)), rng.uniform(0.5, 2.0, (6, 3))
    sd[2, 1] = np.inf
    z = rng.uniform(10, 60, (6, 3))
    ours = scaled.posterior(prior, z, sd, lambda x: _ranges(x, places), scaled.Scaling(1.0, 0.0, 1.0))
    house = ukf.posterior(prior, z, sd, lambda x: _ranges(x, places))
    assert ours.mean == pytest.approx(house.mean)
    assert ours.covariance == pytest.approx(house.covariance)


def test_a_covariance_that_is_indefinite_is_repaired_and_another_left() -> None:
    bad, good = np.diag([4.0, 1.0, 1.0, -1e-3]), np.diag([4.0, 1.0, 1.0, 0.5])
    bad[0, 1], bad[1, 0] = 0.3, 0.1
    found = scaled.repaired(np.stack([bad, good]))
    assert np.linalg.eigvalsh(found[0]).min() == pytest.approx(scaled.LEAST * np.linalg.eigvalsh(found[0]).max())
    assert [found[0, 0, 1], found[0, 1, 0]] == pytest.approx([0.2, 0.2])
    assert found[1] == pytest.approx(good)


def test_who_hears_a_beacon_stays_awake_for_some_steps_and_sleepers_hear_one_in_their_windows_only() -> None:
    until = np.zeros((1, 4), int)
    chosen = {1: [0], 3: [1], 5: [0, 2], 6: [2], 9: [0, 1]}  # for each of these steps, in the step before
    found = []
    for step in range(1, 13):
        slaves = np.array([chosen.get(step, []) + [NOBODY] * (4 - len(chosen.get(step, [])))])
        awake = _awake(until, Chosen(slaves, np.array([0])), step, Waking(listen_every=4, keep=5))
        found.append(np.flatnonzero(awake[0]).tolist())
    # at step 0 the window is open: 0 hears; at 2 it is closed to 1; at 4 open: 0 goes on, 2 wakes; at 5, awake, 2 hears
    # another; at 8 open: 0 goes on, 1 wakes
    assert found == [[0], [0], [0], [0], [0, 2], [0, 2], [0, 2], [0, 2], [0, 1, 2], [0, 1, 2], [0, 1], [0, 1]]


def test_in_its_last_step_awake_a_slave_still_hears_and_one_step_later_it_does_not() -> None:
    for again, expected in ((3, [1, 2, 3, 4]), (4, [1, 2])):
        until, found = np.zeros((1, 1), int), []
        for step in range(1, 7):
            chosen = Chosen(np.array([[0 if step in (1, again) else NOBODY]]), np.array([0]))
            if _awake(until, chosen, step, Waking(listen_every=10, keep=2))[0, 0]:
                found.append(step)
        assert found == expected


def test_without_more_said_those_are_awake_that_the_policy_chooses() -> None:
    plain, awake = followed(SETUP, "closest", "ukf", (1, 2, 3)), []
    truth = drawn(SETUP, (1, 2, 3))
    for step in range(SETUP.steps):
        awake.append(truth.owner == plain.leader[:, step, None])
    assert np.array_equal(plain.awake, np.stack(awake, axis=1))
    longer = followed(SETUP, "merge_until_3", "ukf", (1, 2, 3), waking=Waking(1, 10))
    assert np.all(longer.awake.sum(axis=-1) >= 3)
    rarely = followed(SETUP, "merge_until_3", "ukf", (1, 2, 3), waking=Waking(10, 10)).awake
    assert np.array_equal(rarely[:, :10], np.repeat(rarely[:, :1], 10, axis=1))  # from window to window nobody wakes


def test_a_slave_far_from_the_target_says_that_there_is_none() -> None:
    near, truth = replace(SETUP, detect_m=300.0), drawn(SETUP, (4, 5))
    found = followed(near, "all", "ukf", (4, 5))
    away = np.linalg.norm(truth.slaves[:, None] - truth.path[:, 1:, None, :2], axis=-1)
    assert np.array_equal(found.silent, (away > 300.0).sum(axis=-1))
    every = followed(SETUP, "all", "ukf", (4, 5))
    assert not every.silent.any()
    assert np.all(found.bound > every.bound)
    none = followed(replace(SETUP, detect_m=0.0), "all", "ukf", (4, 5))
    moves, covariance = motion(), truth.prior.covariance[0]
    for step in range(SETUP.steps):  # nothing is known but the start and the motion
        covariance = moves.F @ covariance @ moves.F.T + moves.Q
        assert none.bound[:, step] == pytest.approx(np.sqrt(np.trace(covariance[:2, :2])))
