"""Rao-Blackwellised trackers against Kalman, against counts by hand, and many runs against each alone."""

import itertools

import numpy as np
import pytest

from tests import kalman
from tests.sensing import bearings_model, model_of, reports_of
from trackfield.filters import stacked
from trackfield.filters.belief import Modes, form_of, moments, pack, unpack
from trackfield.filters.blackwell import one
from trackfield.filters.jm_rbpf import JmRbpf
from trackfield.filters.mrbpf import Mrbpf, judged
from trackfield.filters.mrbpf_weightmass import MrbpfWeightmass
from trackfield.filters.needs import unmet
from trackfield.filters.rao_blackwell import Cloud, begin, believed, by_mode, foreseen, moved, resampled
from trackfield.filters.rbpf import Rbpf
from trackfield.filters.turning import STRAIGHT, drawn, evenly_spread, followed, left_and_right, shares
from trackfield.filters.types import Gaussian, Model, Readings, Reports
from trackfield.sensing.complete import Kind
from trackfield.sensing.doa import Doa
from trackfield.sensing.energy import Energy
from trackfield.sensing.range import Range
from trackfield.sensing.rss import Rss

NOISE, Q = 2.0, 0.3
LINEAR = bearings_model(NOISE / kalman.FAR, sigma_v=0.5)
PRIOR = Gaussian(np.array([3.0, -2.0, 1.0, 0.5]), np.diag([9.0, 9.0, 1.0, 1.0]))
SKEW = Gaussian(PRIOR.mean, np.array([[9, 1, 2, 0], [1, 6, 0, 1], [2, 0, 2, 0.5], [0, 1, 0.5, 1]], float))
ENERGY = Model({"energy": Kind("energy", Energy())}, 0.1)
TRACKERS = [
    Rbpf(200, silent=3),
    Mrbpf(200, silent=3),
    Mrbpf(200, draw="multinomial", gamma="share"),
    MrbpfWeightmass(200, silent=3),
    JmRbpf(200, silent=3),
    JmRbpf(200, turn="known"),
    Mrbpf(200, robust=True),
    JmRbpf(200, robust=True),
]


def turn(rate, dt):
    """F (4, 4) of a coordinated turn, as textbooks write it."""
    s, c = np.sin(rate * dt), np.cos(rate * dt)
    a, b = (s / rate, (1.0 - c) / rate) if rate else (dt, 0.0)
    return np.array([[1, 0, a, -b], [0, 1, b, a], [0, 0, c, -s], [0, 0, s, c]])


def noise(dt, q):
    """Q (4, 4) of a white acceleration of density q."""
    return q * np.kron(np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]]), np.eye(2))


def cloud_of(points, rate=0.0, variance=1.0, m=1):
    """Particles with numbers of their own."""
    n = len(points)
    return Cloud(
        np.array(points, float),
        np.full(n, variance) + np.arange(n) / 7.0,
        np.arange(n) % m,
        np.full(n, rate),
        np.eye(m)[0],
        np.array(0),
    )


# --- one particle ---


@pytest.mark.parametrize("rate", [0.0, 0.8, -0.3])
@pytest.mark.parametrize("dt", [1.0, 0.5])
def test_a_particles_update_is_kalmans_of_velocity_and_drawn_position(rate, dt):
    """The joint Gaussian of (z', v'), conditioned on the z' that was drawn."""
    before = cloud_of([[10.0, 20.0, 3.0, -4.0], [5.0, 5.0, 1.0, 2.0]], rate)
    after = moved(before, LINEAR, dt, np.array([[0.4, -1.3], [2.0, 0.1]]), Q)
    F = turn(rate, dt)
    for i in range(2):
        P = F @ np.diag([0, 0, before.variance[i], before.variance[i]]) @ F.T + noise(dt, Q)
        exact = kalman.update(Gaussian(F @ before.points[i], P), after.points[i, :2], np.eye(2, 4), np.zeros((2, 2)))
        assert after.points[i] == pytest.approx(exact.mean)
        assert after.variance[i] * np.eye(2) == pytest.approx(exact.covariance[2:, 2:])


def test_positions_are_drawn_with_the_velocitys_uncertainty():
    before = cloud_of([[10.0, 20.0, 3.0, -4.0]] * 2, 0.8)
    at, up = (moved(before, LINEAR, 1.0, np.full((2, 2), k), Q).points[:, :2] for k in (0.0, 1.0))
    F = turn(0.8, 1.0)
    for i in range(2):
        S = F @ np.diag([0, 0, before.variance[i], before.variance[i]]) @ F.T + noise(1.0, Q)
        assert up[i] - at[i] == pytest.approx(np.sqrt(np.diag(S)[:2]))


# --- the linear case ---


def test_the_linear_case_is_kalmans():
    """Over several seeds mean and covariance scatter as 20,000 particles do (1/sqrt(n) = 0.007), no more."""
    tracker, means, covariances = Rbpf(20_000, q=Q), [], []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        exact, state = SKEW, tracker.init(SKEW, LINEAR)
        for step in range(5):
            z = np.array([3.0 + step, -2.0 + 0.5 * step]) + NOISE * rng.normal(size=2)
            F = turn(0.0, 1.0)
            exact = Gaussian(F @ exact.mean, F @ exact.covariance @ F.T + noise(1.0, Q))
            exact = Gaussian(*kalman.update(exact, z, np.eye(2, 4), NOISE**2 * np.eye(2))[:2])
            state, estimate = tracker.step(state, kalman.far_reports(z), 1.0, rng)
        sd = np.sqrt(np.diag(exact.covariance))
        means.append((estimate.mean - exact.mean) / sd)
        covariances.append((estimate.covariance - exact.covariance) / np.outer(sd, sd))
    for misses, scatter in ((np.array(means), 0.03), (np.array(covariances), 0.05)):
        assert np.sqrt(np.square(misses).mean()) < scatter


@pytest.mark.parametrize("prior", [PRIOR, SKEW])
def test_particles_begin_with_the_priors_moments(prior):
    """Of 100,000 particles: each number within 5 sd of its sample's error, 0.3 % of it."""
    tracker = Rbpf(100_000)
    cloud = begin(one(prior), tracker.start(np.random.default_rng(1), LINEAR), STRAIGHT)
    found = believed(np.full(100_000, 1e-5), cloud)
    sd = np.sqrt(np.diag(prior.covariance))
    assert (found.mean - prior.mean) / sd == pytest.approx(np.zeros(4), abs=0.016)
    assert (found.covariance - prior.covariance) / np.outer(sd, sd) == pytest.approx(np.zeros((4, 4)), abs=0.023)
    assert cloud.variance.min() > 0.0


# --- modes ---


def test_modes_by_hand():
    chances = left_and_right(0.5, 0.2, 0.1, 0.4, 0.05)
    assert chances.switching == pytest.approx(np.array([[0.8, 0.1, 0.1], [0.4, 0.55, 0.05], [0.4, 0.05, 0.55]]))
    assert chances.rates == pytest.approx([0.0, 0.5, -0.2])
    assert drawn(np.array([0.2, 0.5, 0.3]), np.array([0.0, 0.19, 0.21, 0.69, 0.71, 0.99])).tolist() == [
        0,
        0,
        1,
        1,
        2,
        2,
    ]
    assert followed(np.array([0, 0, 1, 1, 2, 2]), np.array([0.79, 0.81, 0.39, 0.96, 0.41, 0.46]), chances).tolist() == [
        0, 1, 0, 2, 1, 2,
    ]  # fmt: skip
    assert shares(np.array([0.1, 0.2, 0.3, 0.4]), np.array([2, 0, 2, 1]), 3) == pytest.approx([0.2, 0.4, 0.4])


def test_a_stratified_draw_has_every_modes_share_and_no_order():
    rng = np.random.default_rng(1)
    draws = [drawn(np.array([0.5, 0.3, 0.2]), evenly_spread(500, rng)) for _ in range(2)]
    for mode in draws:
        assert np.abs(np.bincount(mode) - [250, 150, 100]).max() <= 1
        for half in (mode[:250], mode[250:]):  # the first mode's share has an sd of 0.022
            assert np.bincount(half, minlength=3) / 250 == pytest.approx([0.5, 0.3, 0.2], abs=0.1)
    assert (draws[0] == draws[1]).mean() == pytest.approx(0.38, abs=0.1)  # as of independent ones


def test_a_mode_is_judged_by_its_share_and_the_likelihood_at_its_mean():
    """Step 2b of Table 1: three particles straight ahead, one to the left; none to the right."""
    model, at = model_of(Range(growth_m=0.0, floor_sd_m=2.0)), np.array([[0.0, 0.0]])
    points = [[8.0, 0, 0, 0], [10.0, 0, 0, 0], [12.0, 0, 0, 0], [13.0, 0, 0, 0]]
    cloud = cloud_of(points, m=3)._replace(mode=np.array([0, 0, 0, 1]))
    weight = np.array([np.exp(-0.5 * (11.0 - 10.0) ** 2 / 4.0), np.exp(-0.5 * (11.0 - 13.0) ** 2 / 4.0), 0.0])
    for by_share, times in ((True, np.array([0.75, 0.25, 0.0])), (False, np.ones(3))):
        found = judged(cloud, reports_of(at, np.array([[11.0]])), model, by_share=by_share)
        assert found == pytest.approx(times * weight / (times * weight).sum())


def test_a_turn_of_unknown_rate_draws_it_once_and_keeps_it():
    tracker = JmRbpf(2000, most_deg_s=60.0, q=0.01)
    rng, state = np.random.default_rng(1), tracker.init(PRIOR, LINEAR)
    clouds = []
    for _ in range(4):
        state, _ = tracker.step(state, kalman.far_reports(np.array([3.0, 0.0])).only(np.array([], int)), 1.0, rng)
        clouds.append(state.cloud)
    for before, after in itertools.pairwise(clouds):  # silence: resampling keeps the order
        kept, straight = before.mode == after.mode, after.mode == 0
        assert (after.rate[kept] == before.rate[kept]).all()
        assert (after.rate[straight] == 0.0).all()
        assert (np.sign(after.rate) == np.array([0, 1, -1])[after.mode]).all()
        entered = np.abs(after.rate[~kept & ~straight])
        assert entered.mean() == pytest.approx(np.radians(30.0), rel=0.15)  # of some 300 draws, sd 0.033 of it
        assert entered.max() < np.radians(60.0)


@pytest.mark.parametrize(
    "tracker", [MrbpfWeightmass(4000, left_deg_s=40.0), JmRbpf(4000, left_deg_s=40.0, turn="known")]
)
def test_a_turn_is_found(tracker):
    """A target that turns left by 40 deg/s, seen to 2 m: after five steps nearly every particle does."""
    rng, state = np.random.default_rng(3), tracker.init(Gaussian(np.array([0.0, 0, 20, 0]), np.eye(4)), LINEAR)
    x, F = np.array([0.0, 0.0, 20.0, 0.0]), turn(np.radians(40.0), 1.0)
    for _ in range(5):
        x = F @ x
        state, estimate = tracker.step(state, kalman.far_reports(x[:2] + rng.normal(size=2)), 1.0, rng)
    assert state.cloud.probability[1] > 0.9
    assert estimate.mean == pytest.approx(x, abs=4.0)


# --- the tuple as a whole ---


def test_resampling_moves_the_whole_particle():
    n = 50
    cloud = cloud_of(np.arange(n)[:, None] * np.ones(4), m=3)._replace(rate=np.arange(n) / 10.0)
    after = resampled(cloud, np.linspace(0.0, 1.0, n) ** 3, 0.4)
    ancestor = after.points[:, 0].astype(int)
    assert len(set(ancestor)) < n
    assert (after.points == cloud.points[ancestor]).all()
    for part in ("variance", "mode", "rate"):
        assert (getattr(after, part) == getattr(cloud, part)[ancestor]).all()


# --- many runs ---


def energies(rng, steps):
    """Reports of a target that goes straight ahead: steps without any, and with fewer than four."""
    at, found = rng.uniform(0.0, 250.0, (steps, 4, 2)), []
    for t in range(steps):
        x = np.array([60.0 + 5.0 * t, 60.0 + 4.0 * t, 5.0, 4.0, np.log(1e5)])
        z = ENERGY.sensor.h(x, at[t])
        z = z + np.sqrt(ENERGY.sensor.variance(x, at[t])) * rng.standard_normal(z.shape)
        z[rng.random(4) < 0.3] = np.nan
        if 6 <= t < 10:
            z[:] = np.nan
        found.append((at[t], z))
    return found


def alone(at, z):
    """The reports of one run: those that are there."""
    there = ~np.isnan(z[:, 0])
    return Reports(1, tuple("abcd"[: there.sum()]), at[there], (Readings("energy", z[there]),))


@pytest.mark.parametrize("tracker", TRACKERS, ids=str)
def test_many_runs_at_once_are_each_alone(tracker):
    runs, steps = 4, 14
    heard = [energies(np.random.default_rng(run), steps) for run in range(runs)]
    means = np.array([[50.0 + run, 58.0, 5.0, 4.0, np.log(1e5)] for run in range(runs)])
    prior = Gaussian(means, np.tile(np.diag([25.0, 25.0, 1.0, 1.0, 0.01]), (runs, 1, 1)))
    rngs = [np.random.default_rng(100 + run) for run in range(runs)]
    every = [np.random.default_rng(100 + run) for run in range(runs)]

    def stack(parts):
        return type(parts[0])(*(np.stack(numbers) for numbers in zip(*parts, strict=True)))

    cloud = begin(one(prior), stack([tracker.start(rng, ENERGY) for rng in rngs]), tracker.turns)
    states = [tracker.init(Gaussian(means[run], prior.covariance[run]), ENERGY) for run in range(runs)]
    for t in range(steps):
        draws = [stack([tracker.draws(rng, ENERGY) for rng in rngs]) for _ in range(tracker.looks)]
        at, z = (np.stack([one[t][part] for one in heard]) for part in (0, 1))
        together = Reports(t, (), at, (Readings("energy", z),))
        cloud, posterior = tracker.advance(cloud, together, ENERGY, 1.0, draws[0], draws[-1])
        for run in range(runs):
            states[run], estimate = tracker.step(states[run], alone(*heard[run][t]), 1.0, every[run])
            assert posterior.mean[run] == pytest.approx(estimate.mean, rel=1e-9, abs=1e-9)
            assert posterior.covariance[run] == pytest.approx(estimate.covariance, rel=1e-9, abs=1e-9)
            assert cloud.probability[run] == pytest.approx(states[run].cloud.probability, rel=1e-9)


def test_a_silent_track_starts_anew_around_the_loudest():
    at = np.array([[0.0, 0.0], [40.0, 0.0], [0.0, 40.0], [40.0, 40.0], [200.0, 200.0]])
    z = np.array([[50.0], [40.0], [30.0], [20.0], [3.0]])
    found = Reports(1, tuple("abcde"), at, (Readings("energy", z),))
    none = Reports(1, (), np.empty((0, 2)), (Readings("energy", np.empty((0, 1))),))
    prior = Gaussian(np.array([500.0, 500.0, 0.0, 0.0, np.log(1e5)]), np.diag([9.0, 9.0, 1.0, 1.0, 0.01]))
    for silent, near in ((3, True), (4, False), (0, False)):
        tracker, rng = JmRbpf(2000, silent=silent), np.random.default_rng(1)
        state = tracker.init(prior, ENERGY)
        for reports in (none, none, none, found):
            state, estimate = tracker.step(state, reports, 1.0, rng)
        assert bool(np.hypot(*(estimate.mean[:2] - 20.0)) < 60.0) is near


# --- beliefs, motion, needs ---


def test_what_it_knows_travels_as_a_gaussian_for_each_mode():
    tracker, rng = JmRbpf(3000), np.random.default_rng(1)
    prior = Gaussian(np.array([60.0, 60.0, 5.0, 4.0, np.log(1e5)]), np.diag([25.0, 25.0, 1.0, 1.0, 0.01]))
    state = tracker.init(prior, ENERGY)
    for at, z in energies(rng, 5):
        state, _ = tracker.step(state, alone(at, z), 1.0, rng)
    belief = tracker.belief(state)
    assert isinstance(belief, Modes)
    assert len(pack(belief)) == 252
    whole, equal = moments(belief), np.full(3000, 1 / 3000)
    assert whole.mean == pytest.approx(believed(equal, state.cloud).mean)
    assert np.diag(whole.covariance) == pytest.approx(np.diag(believed(equal, state.cloud).covariance), rel=0.01)
    resumed = tracker.resume(unpack(form_of(belief), 5, pack(belief)), ENERGY)
    cloud = begin(resumed.prior, tracker.start(rng, ENERGY), tracker.turns)
    assert shares(equal, cloud.mode, 3) == pytest.approx(belief.weights, abs=1e-3)
    again, sd = by_mode(cloud), np.sqrt(np.diag(whole.covariance))
    assert (again.means - belief.means) / sd == pytest.approx(np.zeros((3, 5)), abs=0.4)  # the rarest: 200 particles


def test_another_trackers_belief_is_a_prior():
    modes = Modes(np.array([0.25, 0.75]), np.stack([PRIOR.mean, PRIOR.mean + 4.0]), np.stack([PRIOR.covariance] * 2))
    state = JmRbpf().resume(modes, LINEAR)
    assert state.prior.means[0] == pytest.approx(PRIOR.mean + 3.0)
    assert Rbpf().belief(state) is None


def test_the_motion_is_that_of_the_particles_rates():
    rates = np.array([0.0, 0.5, 0.5, -0.2])
    then = np.array([1.0, 2.0, 3.0, -1.0])
    F, Q = foreseen(then, rates, LINEAR, 1.0, Q_ := 0.3)
    each = np.stack([turn(rate, 1.0) for rate in rates])
    apart = (each - each.mean(axis=0)) @ np.array([0.0, 0.0, 3.0, -1.0])
    assert pytest.approx(each.mean(axis=0)) == F
    assert noise(1.0, Q_) + apart.T @ apart / 4 == pytest.approx(Q)


class Doppler(Range):
    """How fast the target comes nearer."""

    def h(self, x, at):
        apart = x[..., None, :2] - at
        return (np.vecdot(apart, x[..., None, 2:4]) / np.linalg.norm(apart, axis=-1))[..., None]

    def jacobian(self, x, at):
        apart = x[..., None, :2] - at
        away = np.linalg.norm(apart, axis=-1)[..., None]
        along = np.vecdot(apart, x[..., None, 2:4])[..., None]
        slopes = np.zeros((*apart.shape[:-1], 1, x.shape[-1]))
        slopes[..., 0, :2] = x[..., None, 2:4] / away - along * apart / away**3
        slopes[..., 0, 2:4] = apart / away
        return slopes


def test_readings_that_depend_on_the_velocity_are_refused():
    assert "do not depend on the target's velocity" in (unmet(JmRbpf, model_of(Doppler()).kinds) or "")
    for kind in (Energy(), Energy(window_s=1.0, sound_m_s=343.0), Range()):
        assert unmet(JmRbpf, model_of(kind).kinds) is None


@pytest.mark.parametrize("kind", [Doa(), Range(), Rss(), Energy()], ids=["doa", "range", "rss", "energy"])
@pytest.mark.parametrize("tracker", [Rbpf(), Mrbpf(), MrbpfWeightmass(), JmRbpf()], ids=str)
def test_every_kind_keeps_a_target(tracker, kind):
    """Four sensors within 50 m of a target that goes straight ahead: after 20 steps it is within 4 sd, and 20 m."""
    model, rng = Model({"own": Kind("own", kind)}, 0.1), np.random.default_rng(1)
    unknown = np.array([one.mean for one in model.unknowns])
    start = np.concatenate(([0.0, 0.0, 6.0, 4.0], unknown))
    sd = np.concatenate(([5.0, 5.0, 1.0, 1.0], [one.sd for one in model.unknowns]))
    state = tracker.init(Gaussian(start, np.diag(np.square(sd))), model)
    for t in range(1, 21):
        x = np.concatenate((start[:2] + t * start[2:4], start[2:4], unknown))
        at = x[:2] + rng.uniform(-35.0, 35.0, (4, 2))
        own = model.sensor
        R = np.square(own.sd) if own.variance is None else own.variance(x, at)
        z = own.h(x, at) + np.sqrt(R) * rng.standard_normal((4, own.m))
        values = z if own.m == len(own.resolution) else np.concatenate((z, np.full((4, 1), 60.0)), axis=1)
        state, estimate = tracker.step(state, reports_of(at, values), 1.0, rng)
    miss, P = estimate.mean[:2] - x[:2], estimate.covariance[:2, :2]
    assert np.hypot(*miss) < 20.0
    assert miss @ np.linalg.solve(P, miss) < 16.0


# --- several targets ---


def test_a_stack_of_one_target_is_the_filter_of_one():
    tracker, rng = JmRbpf(300, turn="known"), np.random.default_rng(1)
    prior = Gaussian(np.array([60.0, 60.0, 5.0, 4.0, np.log(1e5)]), np.diag([25.0, 25.0, 1.0, 1.0, 0.01]))
    single = begin(one(prior), tracker.start(rng, ENERGY), tracker.turns)
    both = Cloud._make(np.asarray(part)[None] for part in single)
    for at, z in energies(rng, 8):
        draws = tracker.draws(rng, ENERGY)
        reports = Reports(1, (), at[None], (Readings("energy", z[None]),))
        batch = Cloud._make(np.asarray(part)[None] for part in single)
        lifted = type(draws)._make(np.asarray(part)[None] for part in draws)
        after, expected = tracker.advance(batch, reports, ENERGY, 1.0, lifted, lifted)
        both, found = stacked.advance(tracker, Energy(), both, z[:, 0], at, ENERGY, 1.0, lifted)
        single = Cloud._make(part[0] for part in after)
        assert found.mean == pytest.approx(expected.mean, rel=1e-9)
        assert found.covariance == pytest.approx(expected.covariance, rel=1e-9)


def test_energies_of_targets_add_up():
    at = np.array([[0.0, 0.0], [30.0, 5.0]])
    points = np.array([[[10.0, 0, 0, 0, 11.0], [12.0, 3, 0, 0, 11.2]], [[50.0, 9, 0, 0, 10.0], [41.0, 2, 0, 0, 10.5]]])
    z, kind = np.array([600.0, 150.0]), Energy()
    received = kind.h(points, at)[..., 0].sum(axis=0)
    R = 0.9298**2 + (0.2 * received) ** 2
    expected = -0.5 * (np.square(z - received) / R + np.log(R)).sum(axis=-1)
    assert stacked.log_likelihood(kind, points, z, at) == pytest.approx(expected)
    half = stacked.log_likelihood(kind, points, np.array([600.0, np.nan]), at)
    assert half == pytest.approx(-0.5 * (np.square(z - received) / R + np.log(R))[:, 0])
