"""Beliefs as bytes: their sizes, what float32 leaves of them, and what foreign bytes can do."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trackfield.filters.belief import (
    MAX_DIMENSION,
    Belief,
    Modes,
    Particles,
    dimension,
    form_of,
    moments,
    pack,
    repaired,
    unpack,
)
from trackfield.filters.gaussian import collapse
from trackfield.filters.types import Array, Gaussian

FLOAT32 = 2.0**-24
"""The largest relative error of rounding to float32."""


def covariance(rng: np.random.Generator, n: int) -> Array:
    """Variances from (1 cm)^2 to (10 km)^2, and correlations of up to some 0.99."""
    root = rng.normal(size=(n, n + 2)) * 10.0 ** rng.uniform(-2.0, 4.0, (n, 1))
    return root @ root.T


def belief(kind: type, rng: np.random.Generator, n: int, many: int) -> Belief:
    means = rng.normal(0.0, 1000.0, (many, n))
    if kind is Gaussian:
        return Gaussian(means[0], covariance(rng, n))
    weights = rng.dirichlet(np.ones(many))
    return Particles(weights, means) if kind is Particles else Modes(weights, means, covariances(rng, n, many))


def covariances(rng: np.random.Generator, n: int, many: int) -> Array:
    return np.array([covariance(rng, n) for _ in range(many)])


def definite(matrix: Array) -> bool:
    """Whether there is a Cholesky factor, which units do not matter for."""
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        return False
    return bool((matrix == matrix.mT).all())


def variances(matrix: Array) -> Array:
    return np.diagonal(matrix, axis1=-2, axis2=-1)


def correlations(matrix: Array) -> Array:
    sd = np.sqrt(variances(matrix))
    scaled: Array = matrix / (sd[..., :, None] * sd[..., None, :])
    return scaled


# --- there and back ---


@settings(max_examples=150)
@given(st.sampled_from([Gaussian, Modes, Particles]), st.integers(1, 8), st.integers(1, 20), st.integers(0, 10**6))
def test_a_belief_comes_back_as_it_left_but_for_the_rounding(kind: type, n: int, many: int, seed: int) -> None:
    one = belief(kind, np.random.default_rng(seed), n, many)
    back = unpack(form_of(one), dimension(one), pack(one))
    assert type(back) is kind
    assert dimension(back) == n
    for part, before, after in zip(one._fields, one, back, strict=True):
        if part.startswith("covariance"):
            assert all(definite(matrix) for matrix in after.reshape(-1, n, n))
            assert np.abs(correlations(after) - correlations(before)).max() < 16 * n * FLOAT32
            assert variances(after) == pytest.approx(variances(before), rel=4 * FLOAT32)
        else:
            assert after == pytest.approx(before, rel=4 * FLOAT32, abs=1e-30)


@pytest.mark.parametrize(
    ("one", "form", "n", "size"),
    [
        (Gaussian(np.zeros(4), np.eye(4)), 1, 4, 56),
        (Modes(np.full(3, 1 / 3), np.zeros((3, 5)), np.tile(np.eye(5), (3, 1, 1))), 2, 5, 252),
        (Modes(np.full(3, 1 / 3), np.zeros((3, 4)), np.tile(np.eye(4), (3, 1, 1))), 2, 4, 180),
        (Particles(np.full(200, 1 / 200), np.zeros((200, 4))), 3, 4, 4000),
        (Gaussian(np.zeros(1), np.eye(1)), 1, 1, 8),
    ],
)
def test_how_long_they_are(one: Belief, form: int, n: int, size: int) -> None:
    assert (form_of(one), dimension(one), len(pack(one))) == (form, n, size)


GOLDEN: list[tuple[Belief, str]] = [
    (
        Gaussian(np.array([1.0, -2.5]), np.array([[4.0, 0.5], [0.5, 9.0]])),
        "0000803f 000020c0 00008040 0000003f 00001041",
    ),
    (
        Modes(np.array([0.75, 0.25]), np.array([[1.0], [-2.0]]), np.array([[[4.0]], [[0.25]]])),
        "0000403f 0000803f 00008040 0000803e 000000c0 0000803e",
    ),
    (
        Particles(np.array([0.5, 0.5]), np.array([[1.0, 2.0], [3.0, -4.0]])),
        "0000003f 0000803f 00000040 0000003f 00004040 000080c0",
    ),
]


@pytest.mark.parametrize(("one", "data"), GOLDEN)
def test_the_bytes_are_what_others_expect(one: Belief, data: str) -> None:
    assert pack(one) == bytes.fromhex(data)
    back = unpack(form_of(one), dimension(one), bytes.fromhex(data))
    for before, after in zip(one, back, strict=True):
        assert after.tolist() == before.tolist()


@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf, 3.5e38, -1e300])
@pytest.mark.parametrize("kind", [Gaussian, Modes, Particles])
def test_what_float32_cannot_hold_is_not_packed(kind: type, number: float) -> None:
    one = belief(kind, np.random.default_rng(1), 4, 3)
    for part in one:
        spoilt = [array.copy() for array in one]
        which = next(i for i, array in enumerate(one) if array is part)
        spoilt[which].flat[0] = number
        with pytest.raises(ValueError, match="not finite, or too large for float32"):
            pack(kind(*spoilt))


def test_weights_sum_to_1_on_arrival() -> None:
    one = unpack(3, 1, np.array([3.0, 10.0, 1.0, 20.0], "<f4").tobytes())
    assert isinstance(one, Particles)
    assert one.weights.tolist() == [0.75, 0.25]


# --- moments ---


def test_moments_of_every_form() -> None:
    rng = np.random.default_rng(2)
    mean, P = np.array([1.0, 2.0]), covariance(rng, 2)
    gaussian = Gaussian(mean, P)
    assert moments(gaussian) is gaussian
    modes = Modes(np.array([0.3, 0.7]), rng.normal(size=(2, 2)), covariances(rng, 2, 2))
    assert moments(modes).covariance == pytest.approx(collapse(*modes).covariance)
    assert moments(modes).mean == pytest.approx(modes.weights @ modes.means)
    cloud = Particles(np.full(4, 0.25), np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 2.0], [0.0, -2.0]]))
    assert moments(cloud).mean == pytest.approx([0.0, 0.0])
    assert moments(cloud).covariance == pytest.approx(np.diag([0.5, 2.0]))


@pytest.mark.parametrize("many", [1, 2, 3])
def test_of_few_particles_too_it_is_positive_definite(many: int) -> None:
    cloud = Particles(np.full(many, 1 / many), np.random.default_rng(3).normal(size=(many, 4)))
    assert definite(moments(cloud).covariance)


# --- repair ---


@pytest.mark.parametrize("seed", range(20))
def test_a_definite_covariance_stays_exactly_as_it_is(seed: int) -> None:
    P = covariance(np.random.default_rng(seed), 5)
    assert np.linalg.eigvalsh(correlations(P))[0] > 1e-5
    assert (repaired(P) == P).all()


@pytest.mark.parametrize("rank", [1, 2, 3])
@pytest.mark.parametrize("seed", range(10))
def test_a_singular_covariance_after_rounding(rank: int, seed: int) -> None:
    """Of rank 1 to 3 in units from 1 mm to 100 km: rounding leaves some of these with a negative variance."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(4, rank)) * 10.0 ** rng.uniform(-3.0, 5.0, (4, 1))
    before = root @ root.T
    rounded = before.astype(np.float32).astype(float)
    rounded = np.triu(rounded) + np.triu(rounded, 1).T
    after = repaired(rounded)
    assert definite(after)
    assert np.diag(after) == pytest.approx(np.diag(before), rel=1e-6)
    assert np.abs(correlations(after) - correlations(before)).max() < 1e-5


def test_rounding_does_leave_covariances_indefinite() -> None:
    """So the repair above has something to do."""
    roots = np.random.default_rng(4).normal(size=(100, 4, 2))
    rounded = (roots @ roots.mT).astype(np.float32).astype(float)
    assert (np.linalg.eigvalsh(rounded)[:, 0] < -1e-9).sum() > 20
    assert not all(definite(one) for one in rounded)
    assert all(definite(one) for one in repaired(rounded))


def test_units_do_not_matter() -> None:
    """A state in mm and one in km are repaired alike."""
    rng = np.random.default_rng(5)
    root = rng.normal(size=(4, 2))
    P, units = root @ root.T, np.diag([1e-6, 1e-3, 1.0, 1e6])
    assert repaired(units @ P @ units) == pytest.approx(units @ repaired(P) @ units, rel=1e-6)


def test_variances_that_float32_cannot_hold_are_as_small_as_it_can() -> None:
    tiny = float(np.finfo(np.float32).tiny)
    after = unpack(1, 2, pack(Gaussian(np.zeros(2), np.diag([1e-60, 4.0]))))
    assert isinstance(after, Gaussian)
    assert after.covariance.tolist() == [[tiny, 0.0], [0.0, 4.0]]
    assert definite(repaired(np.zeros((3, 3))))


@pytest.mark.parametrize("off", [1.0001, 1e3, 1e38])
def test_correlations_beyond_1_are_at_most_1(off: float) -> None:
    after = repaired(np.array([[1.0, off], [off, 1.0]]))
    assert definite(after)
    assert after == pytest.approx(np.ones((2, 2)), abs=1e-5)


def test_of_several_modes_only_the_broken_are_repaired() -> None:
    sound, broken = covariance(np.random.default_rng(6), 3), np.ones((3, 3))
    after = repaired(np.array([sound, broken]))
    assert (after[0] == sound).all()
    assert definite(after[1])
    assert not (after[1] == broken).all()


# --- foreign bytes ---


def floats(*numbers: float) -> bytes:
    return np.array(numbers, "<f4").tobytes()


@pytest.mark.parametrize(
    ("form", "n", "data", "reason"),
    [
        (0, 4, b"", r"of form 0; expected 1, 2 or 3"),
        (4, 4, bytes(56), "of form 4"),
        (1, 0, bytes(56), f"of dimension 0; expected 1 to {MAX_DIMENSION}"),
        (1, -4, bytes(56), "of dimension -4"),
        (1, MAX_DIMENSION + 1, bytes(56), f"of dimension {MAX_DIMENSION + 1}"),
        (1, 10**30, bytes(56), "of dimension 1000"),
        (1, 4, b"", "of 0 bytes; expected 56"),
        (1, 4, bytes(55), "of 55 bytes; expected 56"),
        (1, 4, bytes(112), "of 112 bytes; expected 56"),
        (2, 4, bytes(59), "of 59 bytes; expected a multiple of 60"),
        (3, 4, b"", "of 0 bytes; expected a multiple of 20"),
        (1, 1, floats(np.nan, 1.0), "not finite"),
        (1, 1, floats(0.0, np.inf), "not finite"),
        (1, 1, floats(0.0, -1.0), "a negative variance"),
        (2, 1, floats(1.0, 0.0, 1.0, 1.0, 0.0, -1.0), "a negative variance"),
        (3, 1, floats(1.0, 0.0, -0.5, 0.0), "weights are negative or sum to 0"),
        (3, 1, floats(0.0, 0.0, 0.0, 0.0), "weights are negative or sum to 0"),
        (2, 1, floats(-1.0, 0.0, 1.0), "weights are negative or sum to 0"),
    ],
)
def test_bytes_of_no_belief_say_why(form: int, n: int, data: bytes, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        unpack(form, n, data)


numbers = st.one_of(
    st.floats(width=32), st.sampled_from([0.0, -0.0, 1e-45, 1.2e-38, 3.4e38, -3.4e38, 1.0, float("nan")])
)


@settings(max_examples=400)
@given(st.integers(-1, 5), st.integers(-1, 6), st.one_of(st.binary(max_size=400), st.lists(numbers, max_size=90)))
def test_any_bytes_are_a_sound_belief_or_an_error(form: int, n: int, data: Any) -> None:
    try:
        one = unpack(form, n, data if isinstance(data, bytes) else floats(*data))
    except ValueError:
        return
    assert sound(one)


@settings(max_examples=200)
@given(st.sampled_from([1, 2, 3]), st.integers(1, 5), st.integers(1, 4), st.data())
def test_any_finite_numbers_of_the_right_length(form: int, n: int, many: int, data: st.DataObject) -> None:
    length = n + n * (n + 1) // 2 if form == 1 else many * (1 + n + (n * (n + 1) // 2 if form == 2 else 0))
    finite = st.floats(width=32, allow_nan=False, allow_infinity=False)
    given_numbers = data.draw(st.lists(finite, min_size=length, max_size=length))
    try:
        one = unpack(form, n, floats(*given_numbers))
    except ValueError as error:
        assert "negative" in str(error)
        return
    assert sound(one)


def sound(one: Belief) -> bool:
    """Whether the numbers are finite, the weights sum to 1, and covariances are definite."""
    finite = all(np.isfinite(array).all() for array in one)
    weighed = isinstance(one, Gaussian) or (abs(one[0].sum() - 1.0) < 1e-9 and (one[0] >= 0.0).all())
    matrices = [] if isinstance(one, Particles) else list(one[-1].reshape(-1, dimension(one), dimension(one)))
    return finite and bool(weighed) and all(definite(matrix) for matrix in matrices)
