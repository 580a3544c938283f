"""Beliefs of members that filter, combined: against the exact posterior, and against what errors can be at most.

Everything is drawn by fixed seeds, and compared with exact answers: no test here fails by chance.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.optimize import minimize

from trackfield.filters.types import Array, Gaussian
from trackfield.tracking.combining import (
    LEAST_INFORMATION,
    Combined,
    combined,
    intersection,
    product,
    usable,
    weights,
)

SEEDS = range(20)


@pytest.fixture(autouse=True)
def _no_warnings() -> Iterator[None]:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def drawn_covariance(rng: np.random.Generator, n: int = 4) -> Array:
    """Positive definite, with sds from 0.3 to 30 and correlations of any size."""
    sd = 10.0 ** rng.uniform(-0.5, 1.5, n)
    root = rng.standard_normal((n, n + 2))
    root /= np.linalg.norm(root, axis=1, keepdims=True)
    return sd[:, None] * (root @ root.T) * sd


def updated(prior: Gaussian, H: Array, z: Array, R: Array) -> Gaussian:
    """Kalman's update, in the form of Joseph."""
    gain = np.linalg.solve(H @ prior.covariance @ H.T + R, H @ prior.covariance).T
    rest = np.eye(len(prior.mean)) - gain @ H
    return Gaussian(prior.mean + gain @ (z - H @ prior.mean), rest @ prior.covariance @ rest.T + gain @ R @ gain.T)


@dataclass(frozen=True)
class Cluster:
    """A prior, what each member concludes of it and of its own reading, and what one would of all readings."""

    prior: Gaussian
    members: list[Gaussian]
    central: Gaussian


def cluster(seed: int, m: int = 3, n: int = 4) -> Cluster:
    rng = np.random.default_rng(seed)
    prior = Gaussian(100.0 * rng.standard_normal(n), drawn_covariance(rng, n))
    truth = rng.multivariate_normal(prior.mean, prior.covariance)
    H = rng.standard_normal((m, 1, n)) * 10.0 ** rng.uniform(-1, 1, (m, 1, 1))
    R = 10.0 ** rng.uniform(-1, 1, (m, 1, 1))
    z = H @ truth + np.sqrt(R[..., 0]) * rng.standard_normal((m, 1))
    members = [updated(prior, *one) for one in zip(H, z, R, strict=True)]
    central = updated(prior, H[:, 0], z[:, 0], np.diag(R[:, 0, 0]))
    return Cluster(prior, members, central)


def no_less(a: Array, b: Array, tolerance: float = 1e-9) -> bool:
    """Whether a - b has no eigenvalue below 0, in units of a."""
    root = np.linalg.cholesky(a)
    white = np.linalg.solve(root, np.linalg.solve(root, b).T)
    return bool(np.linalg.eigvalsh((white + white.T) / 2.0)[-1] <= 1.0 + tolerance)


# --- the product ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [1, 2, 4, 5])
@pytest.mark.parametrize("m", [1, 2, 3, 8])
def test_the_product_is_what_one_would_conclude_of_all_readings(m: int, n: int) -> None:
    for seed in SEEDS:
        one = cluster(seed, m, n)
        found = combined("product", one.members, one.prior)
        assert (found.way, found.left_out) == ("product", ())
        sd = np.sqrt(np.diagonal(one.central.covariance))
        assert (found.belief.mean - one.central.mean) / sd == pytest.approx(np.zeros(n), abs=1e-6)
        scale = sd * sd[:, None]
        assert found.belief.covariance / scale == pytest.approx(one.central.covariance / scale, abs=1e-6)
        assert (found.belief.covariance == found.belief.covariance.T).all()


def test_without_taking_off_the_prior_it_would_be_too_sure() -> None:
    """What the correction is worth: the plain product of three beliefs counts the prior three times."""
    one = cluster(1)
    plain = np.linalg.inv(sum(np.linalg.inv(member.covariance) for member in one.members))
    assert not no_less(plain, one.central.covariance)
    found = product(one.members, one.prior)
    assert found is not None
    assert no_less(found.covariance, one.central.covariance, 1e-6)


def test_members_without_a_reading_change_nothing() -> None:
    one = cluster(2)
    found = product([*one.members, one.prior, one.prior], one.prior)
    assert found is not None
    assert found.mean == pytest.approx(one.central.mean)
    assert found.covariance == pytest.approx(one.central.covariance)


def test_a_belief_alone_stays_as_it_is() -> None:
    for way in ("product", "intersection"):
        one = cluster(3)
        found = combined(way, one.members[:1], one.prior)
        assert found.way == way
        assert found.belief.mean == pytest.approx(one.members[0].mean)
        assert found.belief.covariance == pytest.approx(one.members[0].covariance)


def test_the_order_does_not_matter() -> None:
    one = cluster(4)
    for way in ("product", "intersection"):
        here, there = (combined(way, some, one.prior).belief for some in (one.members, one.members[::-1]))
        assert here.mean == pytest.approx(there.mean)
        assert here.covariance == pytest.approx(there.covariance)


def test_a_cluster_that_tracks_for_long_is_as_good_as_a_filter_with_all_readings() -> None:
    """Each step's combination is the prior of the next: rounding does not add up."""
    rng = np.random.default_rng(5)
    F = np.array([[1, 0, 1, 0], [0, 1, 0, 1], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    G = np.array([[0.5, 0], [0, 0.5], [1, 0], [0, 1.0]])
    ours = central = Gaussian(np.zeros(4), np.diag([0.25, 0.25, 0.01, 0.01]))
    for _ in range(300):
        H, z = rng.standard_normal((3, 1, 4)) * [1, 1, 0, 0], 5.0 * rng.standard_normal((3, 1))
        ours, central = (Gaussian(F @ b.mean, F @ b.covariance @ F.T + 0.01 * G @ G.T) for b in (ours, central))
        found = combined("product", [updated(ours, h, y, np.eye(1)) for h, y in zip(H, z, strict=True)], ours)
        assert found.way == "product"
        ours, central = found.belief, updated(central, H[:, 0], z[:, 0], np.eye(3))
    assert ours.mean == pytest.approx(central.mean, rel=1e-7, abs=1e-7)
    assert ours.covariance == pytest.approx(central.covariance, rel=1e-7, abs=1e-9)


# --- covariance intersection ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", ["determinant", "trace"])
@pytest.mark.parametrize("m", [2, 3, 6])
def test_the_intersection_is_not_overconfident_however_errors_depend_on_each_other(m: int, size: str) -> None:
    """The covariance of its error, exactly, for joint covariances of the members' errors drawn at random.

    The beliefs' own covariances are those of the joint one, or wider.
    """
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        root = rng.standard_normal((4 * m, 4 if seed % 2 else 4 * m))  # every other one as dependent as can be
        joint = root @ root.T + 1e-3 * np.eye(4 * m)
        blocks = joint.reshape(m, 4, m, 4)
        own = [blocks[i, :, i] * (1.0 + seed % 3) for i in range(m)]
        found = intersection([Gaussian(np.zeros(4), P) for P in own], size)
        gains = [  # what the mean adds of each member's error, found by moving one mean at a time
            np.array([intersection([Gaussian(e * (i == j), own[j]) for j in range(m)], size).mean for e in np.eye(4)]).T
            for i in range(m)
        ]
        gain = np.hstack(gains)
        assert sum(gains) == pytest.approx(np.eye(4), abs=1e-6)  # unbiased
        assert no_less(found.covariance, gain @ joint @ gain.T, 1e-6)


def test_members_of_one_prior_are_overconfident_as_a_product_of_their_own_but_not_as_an_intersection() -> None:
    for seed in SEEDS:
        one = cluster(seed)
        found = combined("intersection", one.members, one.prior)
        assert found.way == "intersection"
        assert no_less(found.belief.covariance, one.central.covariance, 1e-6)


@pytest.mark.parametrize("size", ["determinant", "trace"])
def test_no_other_weights_make_it_smaller(size: str) -> None:
    """Against a general minimiser, over the logarithms of weights."""
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        beliefs = [Gaussian(np.zeros(4), drawn_covariance(rng)) for _ in range(3)]
        informations = np.array([np.linalg.inv(P) for _, P in beliefs])

        def measure(covariance: Array) -> float:
            return float(np.linalg.slogdet(covariance)[1] if size == "determinant" else np.trace(covariance))

        def objective(logs: Array, informations: Array = informations) -> float:
            w = np.exp(logs - logs.max())
            return measure(np.linalg.inv(np.einsum("m,mij->ij", w / w.sum(), informations)))

        best = min(minimize(objective, start, method="Nelder-Mead").fun for start in (np.zeros(3), *(5 * np.eye(3))))
        found = measure(intersection(beliefs, size).covariance)
        assert found <= (best + 0.005 if size == "determinant" else best * 1.0025)


def test_a_belief_that_is_better_in_every_direction_gets_all_the_weight() -> None:
    one = cluster(6)
    better, worse = one.central, Gaussian(one.prior.mean, 1.5 * one.prior.covariance)
    informations = np.array([np.linalg.inv(b.covariance) for b in (worse, better)])
    assert weights(informations) == pytest.approx([0.0, 1.0], abs=0.01)
    assert weights(informations, np.ones(4)) == pytest.approx([0.0, 1.0], abs=0.01)


def test_beliefs_that_know_different_things_share_the_weight() -> None:
    """One knows x to 1 m and y to 10 m, the other the reverse: half and half, so that both are known to 1.407 m."""
    beliefs = [Gaussian(np.array([5.0, 0.0]), np.diag([1, 100.0])), Gaussian(np.array([0.0, 7.0]), np.diag([100, 1.0]))]
    for size in ("determinant", "trace"):
        found = intersection(beliefs, size)
        assert found.covariance == pytest.approx(np.diag([2 / 1.01, 2 / 1.01]), abs=1e-6)
        assert found.mean == pytest.approx([5.0 / 1.01, 7.0 / 1.01], abs=1e-6)


def test_its_weights_by_determinant_do_not_depend_on_units() -> None:
    rng = np.random.default_rng(7)
    beliefs = [Gaussian(rng.standard_normal(4), drawn_covariance(rng)) for _ in range(3)]
    units = np.array([1e3, 1e3, 3.6, 3.6])
    other = intersection([Gaussian(units * m, units[:, None] * P * units) for m, P in beliefs])
    found = intersection(beliefs)
    assert other.mean / units == pytest.approx(found.mean)
    assert other.covariance / units / units[:, None] == pytest.approx(found.covariance)


# --- what has no answer -----------------------------------------------------------------------------------------------

BAD = {
    "not a number": Gaussian(np.full(4, np.nan), np.eye(4)),
    "an infinite mean": Gaussian(np.array([np.inf, 0, 0, 0]), np.eye(4)),
    "an infinite variance": Gaussian(np.zeros(4), np.diag([np.inf, 1, 1, 1])),
    "no variance": Gaussian(np.zeros(4), np.diag([0.0, 1, 1, 1])),
    "a negative variance": Gaussian(np.zeros(4), np.diag([-1.0, 1, 1, 1])),
    "no correlation": Gaussian(np.zeros(4), np.eye(4) + 2.0 * (np.eye(4, k=1) + np.eye(4, k=-1))),
    "all correlated": Gaussian(np.zeros(4), np.ones((4, 4))),
    "nearly all correlated": Gaussian(np.zeros(4), np.ones((4, 4)) + 1e-13 * np.eye(4)),
    "another size": Gaussian(np.zeros(5), np.eye(5)),
    "a covariance of another size": Gaussian(np.zeros(4), np.eye(3)),
    "far too large": Gaussian(np.full(4, 1e200), np.eye(4) * 1e200),
    "far too small": Gaussian(np.zeros(4), np.eye(4) * 1e-300),
}


@pytest.mark.parametrize("what", BAD)
@pytest.mark.parametrize("way", ["product", "intersection"])
def test_a_belief_that_is_none_is_left_out_and_named(way: str, what: str) -> None:
    one = cluster(8)
    assert not usable(BAD[what], 4)
    found = combined(way, [one.members[0], BAD[what], *one.members[1:], BAD[what]], one.prior)
    assert (found.way, found.left_out) == (way, (1, 4))
    expected = combined(way, one.members, one.prior).belief
    assert found.belief.mean == pytest.approx(expected.mean)
    assert found.belief.covariance == pytest.approx(expected.covariance)


@pytest.mark.parametrize("way", ["product", "intersection"])
def test_with_nothing_to_combine_the_prior_stays(way: str) -> None:
    one = cluster(9)
    assert combined(way, [], one.prior) == Combined(one.prior, "prior")
    assert combined(way, list(BAD.values()), one.prior) == Combined(one.prior, "prior", tuple(range(len(BAD))))


@pytest.mark.parametrize("what", sorted(set(BAD) - {"another size"}))
def test_of_a_prior_that_is_none_there_is_no_product(what: str) -> None:
    one = cluster(10)
    found = combined("product", one.members, BAD[what])
    assert found.way == "intersection"
    assert found.belief.mean == pytest.approx(intersection(one.members).mean)


def test_beliefs_that_cannot_come_of_the_prior_are_intersected() -> None:
    """Three that are each half as certain as the prior: 3 / 2 - 2 of its information would be left."""
    one = cluster(11)
    wide = [Gaussian(one.prior.mean + k, 2.0 * one.prior.covariance) for k in range(3)]
    assert product(wide, one.prior) is None
    found = combined("product", wide, one.prior)
    assert found.way == "intersection"
    assert found.belief.covariance == pytest.approx(2.0 * one.prior.covariance)
    little = (LEAST_INFORMATION + 1e-3 + 2.0) / 3.0  # just enough
    some = product([Gaussian(one.prior.mean, one.prior.covariance / little)] * 3, one.prior)
    assert some is not None
    assert some.covariance == pytest.approx(one.prior.covariance / (LEAST_INFORMATION + 1e-3))


@pytest.mark.parametrize("decades", [4, 8, 12, 16, 40])
def test_beliefs_of_any_condition_raise_nothing(decades: float) -> None:
    """Covariances turned at random, whose axes differ by so many decades: what comes out is a belief."""
    for seed in range(60):
        rng = np.random.default_rng(seed)
        beliefs = []
        for _ in range(4):
            turn = np.linalg.qr(rng.standard_normal((4, 4)))[0]
            variances = 10.0 ** rng.uniform(-decades / 2, decades / 2, 4)
            covariance = turn * variances @ turn.T
            beliefs.append(Gaussian(1e3 * rng.standard_normal(4), (covariance + covariance.T) / 2.0))
        prior, *members = beliefs
        for way in ("product", "intersection"):
            found = combined(way, members, prior)
            if found.way == "prior":
                assert found.left_out == (0, 1, 2)
            else:
                assert usable(found.belief, 4)
                assert (found.belief.covariance == found.belief.covariance.T).all()
