"""The fix against a brute-force search, against Kalman, and at geometries that give little."""

import numpy as np
import pytest

from tests import kalman
from tests.sensing import bearings_model
from tests.zhai_field import GRID, MODEL, SIGMA_W, hear, only
from trackfield.filters.fix import centroid, map_fix
from trackfield.filters.gaussian import extent
from trackfield.filters.measurement import intensity_weights
from trackfield.filters.types import Gaussian, of_bearings
from trackfield.models import doa
from trackfield.models.sound import wrap


def reports(positions, bearings, levels=None):
    positions = np.array(positions, dtype=float)
    levels = np.full(len(positions), 60.0) if levels is None else np.array(levels)
    return of_bearings(0, tuple("abcdefgh"[: len(positions)]), positions, np.array(bearings, dtype=float), levels)


def cost(prior, reports, sigma_w, positions):
    """-2 log of the posterior at positions (n, 2), with the velocities that are likeliest there."""
    apart = positions - prior.mean[:2]
    misses = wrap(reports.bearings - doa.measure(positions, reports.positions)) / sigma_w
    inverse = np.linalg.inv(prior.covariance[:2, :2])
    return np.einsum("ni,ij,nj->n", apart, inverse, apart) + np.square(misses).sum(axis=-1)


def brute_force(prior, reports, sigma_w):
    """The best position on a grid over 4 sd of the prior, refined until its cells are below a micrometre."""
    centre, half = prior.mean[:2], 4.0 * np.sqrt(np.diag(prior.covariance)[:2])
    for _ in range(12):
        offsets = np.stack(np.meshgrid(*[np.linspace(-1.0, 1.0, 161)] * 2), axis=-1).reshape(-1, 2)
        points = centre + half * offsets
        centre = points[cost(prior, reports, sigma_w, points).argmin()]
        half = half / 8.0
    return centre


@pytest.mark.parametrize("seed", range(25))
def test_fix_is_the_best_point_of_a_brute_force_search(seed):
    rng = np.random.default_rng(seed)
    truth = np.concatenate((rng.uniform(100.0, 400.0, 2), [6.0, 5.0]))
    A = rng.normal(size=(4, 4))
    P = np.diag([20.0, 20.0, 4.0, 4.0]) @ (np.eye(4) + 0.1 * A @ A.T) @ np.diag([20.0, 20.0, 4.0, 4.0])
    prior = Gaussian(truth + np.linalg.cholesky(P) @ rng.normal(size=4), P)
    heard = hear(truth[:2], rng)
    fix = map_fix(prior, heard, MODEL).posterior
    best = brute_force(prior, heard, SIGMA_W)
    assert fix.mean[:2] == pytest.approx(best, abs=1e-4)
    # velocities follow the position by the prior's correlation
    gain = P[2:, :2] @ np.linalg.inv(P[:2, :2])
    assert fix.mean[2:] == pytest.approx(prior.mean[2:] + gain @ (fix.mean[:2] - prior.mean[:2]), abs=1e-5)


@pytest.mark.parametrize("seed", range(8))
def test_linear_case_is_kalmans_mean_covariance_and_evidence(seed):
    rng = np.random.default_rng(seed)
    A = rng.normal(0.0, 3.0, (4, 4))
    prior = Gaussian(rng.normal(0.0, 9.0, 4), A @ A.T + np.eye(4))
    z = rng.normal(0.0, 9.0, 2)
    exact = kalman.update(prior, z, np.eye(2, 4), 4.0 * np.eye(2))
    posterior, log_evidence = map_fix(prior, kalman.far_reports(z), bearings_model(2.0 / kalman.FAR))
    assert posterior.mean == pytest.approx(exact.mean, abs=1e-3)
    assert posterior.covariance == pytest.approx(exact.covariance, rel=1e-4, abs=1e-3)
    # a density per radian of each of two bearings, not per metre
    assert log_evidence - 2.0 * np.log(kalman.FAR) == pytest.approx(exact.log_evidence, rel=1e-4)


def nees_of_fixes(truths, rng):
    """Position NEES of the fixes from a wide prior at each of the true positions (n, 2)."""
    P, nees = np.diag([400.0, 400.0, 16.0, 16.0]), []
    for truth in truths:
        prior = Gaussian(np.append(truth + 20.0 * rng.normal(size=2), [0.0, 0.0]), P)
        fix = map_fix(prior, hear(truth, rng), MODEL).posterior
        error = fix.mean[:2] - truth
        nees.append(error @ np.linalg.inv(fix.covariance[:2, :2]) @ error)
    return np.array(nees)


def test_covariance_tells_the_error():
    """Over many fixes the errors are as large as the covariances say: NEES about 2 in position."""
    rng = np.random.default_rng(0)
    assert 1.7 < nees_of_fixes(rng.uniform(150.0, 350.0, (400, 2)), rng).mean() < 2.3


@pytest.mark.parametrize("near", [0.0, 0.01, 0.5, 2.0])
def test_next_to_a_sensor_a_fix_is_no_surer_than_its_neighbours_make_it(near):
    """Its bearing turns round within a step; taken at its slope it would place the target to millimetres."""
    truths = np.tile(GRID[60] + near * np.array([0.6, 0.8]), (60, 1))
    assert nees_of_fixes(truths, np.random.default_rng(1)).mean() < 3.0


def test_exact_bearings_across_the_cut_of_the_angle():
    truth = np.array([0.0, -40.0])
    sensors = np.array([(0.0, 0.0), (1.0, 30.0), (40.0, -40.0)])
    heard = reports(sensors, doa.measure(truth, sensors))
    turned = reports(sensors, heard.bearings + 2.0 * np.pi * np.array([1.0, -1.0, 2.0]))
    prior = Gaussian(np.array([10.0, -20.0, 0.0, 0.0]), np.diag([1e6, 1e6, 1.0, 1.0]))
    for each in (heard, turned):
        assert map_fix(prior, each, bearings_model(0.05)).posterior.mean[:2] == pytest.approx(truth, abs=1e-3)


def test_one_bearing_leaves_the_range_to_the_prior():
    prior = Gaussian(np.array([5.0, 60.0, 0.0, 0.0]), np.diag([400.0, 400.0, 16.0, 16.0]))
    fix = map_fix(prior, reports([(0.0, 0.0)], [0.0]), bearings_model(0.05)).posterior
    assert fix.mean[:2] == pytest.approx([0.0, 60.0], abs=1.0)
    assert np.sqrt(fix.covariance[1, 1]) == pytest.approx(20.0, rel=0.05)
    assert np.sqrt(fix.covariance[0, 0]) == pytest.approx(3.0, rel=0.15)  # 0.05 rad at 60 m


@pytest.mark.parametrize("seed", range(12))
def test_with_one_sensor_the_prior_is_the_start(seed):
    """The centroid is then the sensor itself, where bearings have no slope."""
    rng = np.random.default_rng(seed)
    prior = Gaussian(np.array([230.0, 140.0, 0.0, 0.0]), np.diag([60.0, 60.0, 4.0, 4.0]) ** 2)
    heard = only(hear(prior.mean[:2] + rng.normal(0.0, 20.0, 2), rng), [0])
    fix = map_fix(prior, heard, MODEL).posterior
    found = cost(prior, heard, SIGMA_W, np.stack((fix.mean[:2], brute_force(prior, heard, SIGMA_W))))
    assert found[0] < found[1] + 0.5


@pytest.mark.parametrize("sd", [20.0, 60.0, 200.0])
def test_under_a_prior_that_is_off_the_fix_is_still_likelier_than_the_truth(sd):
    """Two bearings only, and the prior errs by 2.5 of its sd: no local optimum is taken for the fix."""
    rng, P = np.random.default_rng(0), np.diag([sd, sd, 4.0, 4.0]) ** 2
    for _ in range(150):
        truth, aside = rng.uniform(150.0, 350.0, 2), rng.uniform(-np.pi, np.pi)
        mean = truth + 2.5 * sd * np.array([np.sin(aside), np.cos(aside)])
        prior = Gaussian(np.append(mean, [0.0, 0.0]), P)
        heard = only(hear(truth, rng), [0, -1])
        fix = map_fix(prior, heard, MODEL).posterior
        at_fix, at_truth = cost(prior, heard, SIGMA_W, np.stack((fix.mean[:2], truth)))
        assert at_fix <= at_truth


@pytest.mark.parametrize("P", [np.zeros((4, 4)), np.diag([9.0, 0.0, 1.0, 0.0])])
def test_a_singular_prior_stays_where_it_has_no_extent(P):
    prior = Gaussian(np.array([30.0, 40.0, 1.0, 2.0]), P)
    heard = reports(GRID[:3], doa.measure(np.array([33.0, 40.0]), GRID[:3]))
    fix = map_fix(prior, heard, bearings_model(0.01)).posterior
    fixed = np.diag(P) == 0.0
    assert fix.mean[fixed] == pytest.approx(prior.mean[fixed])
    if P.any():
        assert fix.mean[0] == pytest.approx(33.0, abs=0.2)


def test_intensity_weights_are_shares_of_power():
    assert intensity_weights(np.array([60.0, 50.0, 50.0])) == pytest.approx(np.array([10.0, 1.0, 1.0]) / 12.0)
    assert intensity_weights(np.array([-4e3])) == pytest.approx([1.0])
    heard = reports([(0.0, 0.0), (11.0, 22.0)], [0.0, 0.0], [60.0, 50.0])
    assert centroid(MODEL, heard) == pytest.approx([1.0, 2.0])


@pytest.mark.parametrize("sd", [1e2, 1e4, 1e6])
@pytest.mark.parametrize("off", [1e-5, 1e-4, 1e-3, 1e-2])
def test_a_wide_prior_around_the_sensor_itself(off: float, sd: float) -> None:
    """One bearing of a radar, from a track that has come to lie on it: steep, and still nothing is singular."""
    prior = Gaussian(np.array([off, 0.0, 10.0, 0.0]), np.diag(np.square([sd, sd, 10.0, 10.0])))
    fix, log_evidence = map_fix(prior, reports(np.array([[0.0, 0.0]]), [0.5]), bearings_model(0.0035))
    assert np.isfinite(log_evidence)
    assert np.linalg.eigvalsh(fix.covariance).min() > 0.0
    assert extent(fix.covariance) == pytest.approx(sd, rel=1e-3)  # its distance stays unknown
