"""Range, strength and energy: what trackers take readings to be, against exact answers, and against what nodes read."""

from __future__ import annotations

from math import hypot, log
from typing import Any, Final

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.stats import norm

from trackfield.filters.measurement import expected, jacobians, log_likelihood, noise_sd, sensing_information
from trackfield.filters.types import Array, Model, Readings, Reports
from trackfield.models.unknowns import Unknown
from trackfield.sensing.complete import Kind
from trackfield.sensing.energy import Energy
from trackfield.sensing.range import Range
from trackfield.sensing.rss import Rss
from trackfield.tracking.following import ANYWHERE
from trackfield.world.path import Path
from trackfield.world.scene import Scene, Still

PLACES: Final = np.array([[0.0, 0.0], [60.0, 10.0], [-20.0, 80.0], [90.0, 90.0]])
OWN: Final[dict[str, Any]] = {"range": Range, "rss": Rss, "energy": Energy}
NS: Final = 1_000_000_000

metres = st.floats(-80.0, 80.0)
speeds = st.floats(-25.0, 25.0)
some_range = st.builds(Range, floor_sd_m=st.floats(0.1, 5.0), growth_m=st.just(0.0) | st.floats(0.001, 1.0))
some_rss = st.builds(Rss, exponent=st.floats(1.5, 5.0), shadow_sd_db=st.floats(0.5, 8.0), floor_m=st.floats(0.1, 5.0))
some_energy = st.builds(
    Energy,
    alpha=st.floats(1.0, 4.0),
    gain=st.floats(0.1, 10.0),
    floor_m=st.floats(0.1, 5.0),
    relative=st.floats(0.0, 0.5),
    window_s=st.just(0.0) | st.floats(0.1, 2.0),
    sound_m_s=st.just(0.0) | st.floats(100.0, 1500.0),
    compensate_window=st.booleans(),
    compensate_delay=st.booleans(),
)
kinds = st.one_of(
    some_range.map(lambda own: Kind("range", own)),
    some_rss.map(lambda own: Kind("rss", own)),
    some_energy.map(lambda own: Kind("energy", own)),
)


def kind_of(name: str, **options: Any) -> Kind:
    return Kind(name, OWN[name](**options))


def state_of(kind: Kind, *moving: float) -> Array:
    """A state (x, y, vx, vy) with the means of the kind's unknowns."""
    return np.array([*moving, *(one.mean for one in kind.unknowns)])


def differences(kind: Kind, x: Array) -> Array:
    """dh/dx (K, m, n) by central differences of high order."""
    slopes = []
    for i in range(len(x)):
        step = 1e-4 * np.eye(len(x))[i]
        near, far = (kind.h(x + k * step, PLACES) - kind.h(x - k * step, PLACES) for k in (1, 2))
        slopes.append((8.0 * near - far) / 12e-4)
    return np.stack(slopes, axis=-1)


@given(kinds, metres, metres, speeds, speeds)
def test_slopes_are_those_of_differences(kind: Kind, x: float, y: float, vx: float, vy: float) -> None:
    state = state_of(kind, x, y, vx, vy)
    floor = getattr(kind.own, "floor_m", 0.0)
    back = getattr(kind.own, "window_s", 0.0) / 2.0
    for there in (state[:2], state[:2] - back * state[2:4]):
        away = np.hypot(*(there - PLACES).T)
        assume(away.min() > 1.0 and np.abs(away - floor).min() > 0.5)
    if getattr(kind.own, "sound_m_s", 0.0):
        assume(floor < 0.5 or np.hypot(*(state[:2] - PLACES).T).min() > 60.0)  # its delay moves where the floor is
    slopes = differences(kind, state)
    scale = np.abs(slopes).max(axis=-1, keepdims=True) + 1e-9
    assert kind.jacobian(state, PLACES) / scale == pytest.approx(slopes / scale, abs=1e-6)


@given(kinds, metres, metres)
def test_many_states_are_as_each_alone(kind: Kind, x: float, y: float) -> None:
    """With leading axes, of states and of runs, whose sensors stand elsewhere."""
    states = np.stack([state_of(kind, x + k, y - k, 3.0 + k, -2.0) for k in range(6)]).reshape(2, 3, -1)
    at = np.stack([PLACES, PLACES + 7.0])
    for method in (kind.h, kind.jacobian, *([kind.variance] if kind.variance else [])):
        every = method(states, at[:, None])
        alone = [[method(one, at[r]) for one in states[r]] for r in range(2)]
        assert every == pytest.approx(np.array(alone), rel=1e-12)


@given(kinds, metres, metres, st.floats(-3.0, 3.0))
def test_a_node_reads_what_trackers_expect(kind: Kind, x: float, y: float, draw: float) -> None:
    """Of a target at rest: h without noise, and noise of the variance that trackers are told."""
    state = state_of(kind, x, y, 0.0, 0.0)
    sd = np.sqrt(kind.variance(state, PLACES) if kind.variance else np.square(kind.sd))
    for k, (east, north) in enumerate(PLACES.tolist()):
        away = hypot(x - east, y - north)
        assume(abs(away - kind.range_m) > 1e-6)
        read = kind.simulate(Still((x, y, 0.0, 0.0)), 5 * NS, (east, north), (draw,))
        assert (read is None) == (away > kind.range_m)
        if read is not None:
            exact = kind.h(state, PLACES)[k, 0] + draw * np.broadcast_to(sd, (len(PLACES), 1))[k, 0]
            assert read[0] == pytest.approx(exact, rel=1e-9, abs=1e-9)


def test_the_variance_of_a_range_grows_with_it_from_a_floor_on() -> None:
    kind = kind_of("range", floor_sd_m=0.5, growth_m=0.05)
    assert kind.variance is not None
    x = state_of(kind, 0.0, 0.0, 0.0, 0.0)
    assert kind.variance(x, np.array([[2.0, 0.0], [5.0, 0.0], [0.0, 40.0]]))[:, 0].tolist() == [0.25, 0.25, 2.0]
    assert kind_of("range", growth_m=0.0).variance is None  # and so it is a constant for whoever asks


def test_the_variance_of_an_energy_is_that_of_noise_and_calibration() -> None:
    kind = kind_of("energy", emitted=1e4, alpha=2.0, gain=0.5, noise=3.0, relative=0.1)
    assert kind.variance is not None
    x = state_of(kind, 0.0, 0.0, 0.0, 0.0)
    assert kind.h(x, np.array([[10.0, 0.0]]))[0, 0] == pytest.approx(50.0)
    assert kind.variance(x, np.array([[10.0, 0.0]]))[0, 0] == pytest.approx(9.0 + 25.0)


def test_a_level_falls_by_ten_n_decibels_a_decade() -> None:
    kind = kind_of("rss", level_dbm=-40.0, exponent=3.0)
    at = np.array([[1.0, 0.0], [10.0, 0.0], [0.0, 100.0], [0.01, 0.0]])
    assert kind.h(state_of(kind, 0.0, 0.0, 0.0, 0.0), at)[:, 0] == pytest.approx([-40.0, -70.0, -100.0, -10.0])


# --- readings from anywhere -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "lowest", "highest"),
    [
        (kind_of("range"), 0.0, 100.0),
        (kind_of("rss"), -100.0 - 12.0, -40.0 + 12.0),
        (kind_of("rss", shadow_sd_db=6.0, exponent=2.0), -80.0 - 18.0, -40.0 + 18.0),
        (kind_of("energy"), -3.0 * 0.9298, 1e5 * 2.0**-2.0929),
        (kind_of("energy", noise=5.0, floor_m=10.0), -15.0, 1e5 * 10.0**-2.0929),
    ],
    ids=lambda value: value.name if isinstance(value, Kind) else None,
)
def test_the_density_of_false_readings_is_one(kind: Kind, lowest: float, highest: float) -> None:
    """Its integral is 1, and nearly all readings of targets anywhere within range are where it is."""
    assert kind.log_clutter is not None
    fine = np.concatenate((np.linspace(lowest, highest, 20_001), np.geomspace(1e-3, 1e6, 20_001)))
    z = np.unique(np.clip(fine, lowest, highest))
    density = np.exp(kind.log_clutter(z[:, None], np.zeros((len(z), 2))))
    assert np.trapezoid(density, z) == pytest.approx(1.0, abs=2e-3)
    rng = np.random.default_rng(1)
    away = kind.range_m * np.sqrt(rng.uniform(size=2000))
    scenes = (Still((one, 0.0, 0.0, 0.0)) for one in away)
    read = [kind.simulate(scene, 0, (0.0, 0.0), (rng.normal(),)) for scene in scenes]
    inside = [lowest <= values[0] <= highest for values in read if values is not None]
    assert len(inside) == 2000 and np.mean(inside) > 0.97


@pytest.mark.parametrize("name", OWN)
def test_the_nearer_the_louder(name: str) -> None:
    kind = kind_of(name)
    away = np.array([3.0, 10.0, 30.0, 100.0])
    z = kind.h(state_of(kind, 0.0, 0.0, 0.0, 0.0), np.column_stack((away, 0.0 * away)))
    loud = kind.loudness(z)
    assert loud.shape == (4,) and (np.diff(loud) < 0.0).all()
    decade = {"range": 20.0, "rss": 30.0, "energy": 20.929}[name]
    assert loud[1] - loud[3] == pytest.approx(decade)
    assert kind.loudness(z[None])[0] == pytest.approx(loud)


# --- a start ----------------------------------------------------------------------------------------------------------


def test_energies_start_at_the_centroid_of_the_four_loudest() -> None:
    kind = kind_of("energy")
    assert kind.fix is not None
    at = np.array([[0.0, 0.0], [40.0, 0.0], [0.0, 40.0], [40.0, 40.0], [500.0, 500.0], [-500.0, 0.0]])
    z = np.array([[30.0], [20.0], [25.0], [22.0], [1.0], [-0.5]])
    belief = kind.fix(z, at, ANYWHERE)
    assert belief is not None
    assert belief.mean.tolist() == [20.0, 20.0, 0.0, 0.0]
    assert np.sqrt(np.diag(belief.covariance)).tolist() == [20.0, 20.0, 10.0, 10.0]  # those of the square, of ANYWHERE
    assert kind.fix(z[:3], at[:3], ANYWHERE) is None
    same = kind.fix(z[:4], np.zeros((4, 2)), ANYWHERE)
    assert same is not None and same.covariance[0, 0] == 4.0  # no better than the floor


# --- the bound, and the likelihood ------------------------------------------------------------------------------------


def reports(kind: Kind, z: Array) -> Reports:
    return Reports(1, tuple("abcd"), PLACES, (Readings(kind.name, z),))


@pytest.mark.parametrize(
    "kind",
    [
        kind_of("range", growth_m=0.2),
        kind_of("range", growth_m=0.0),
        kind_of("rss", shadow_sd_db=2.0),
        kind_of("energy"),
        kind_of("energy", window_s=1.0, sound_m_s=343.0),
    ],
    ids=lambda kind: kind.name,
)
def test_the_information_is_the_mean_of_the_scores_outer_product(kind: Kind) -> None:
    """By its definition (Kay 1993, eq. 3.20), each reading's mean by Gauss-Hermite quadrature over its density."""
    model = Model({kind.name: kind})
    state = state_of(kind, 30.0, 25.0, 6.0, -4.0)
    heard = reports(kind, kind.h(state, PLACES))
    nodes, weights = np.polynomial.hermite_e.hermegauss(20)
    weights = weights / weights.sum()
    n, step = len(state), 1e-4
    D = np.zeros((n, n))

    def log_density(x: Array, z: Array, place: Array) -> Array:
        mean, sd = kind.h(x, place)[0, 0], kind.sd[0] if kind.variance is None else kind.variance(x, place)[0, 0] ** 0.5
        found: Array = norm.logpdf(z, mean, sd)
        return found

    for k, sd in enumerate(noise_sd(model, heard, state)):
        place = PLACES[k][None]
        z = kind.h(state, place)[0, 0] + sd * nodes
        around = step * np.eye(n)
        scores = np.array([log_density(state + e, z, place) - log_density(state - e, z, place) for e in around])
        D += np.einsum("an,bn,n->ab", scores / (2.0 * step), scores / (2.0 * step), weights)
    found = sensing_information(model, state, heard)
    scale = np.sqrt(np.outer(np.diag(D), np.diag(D))) + 1e-12
    assert found / scale == pytest.approx(D / scale, abs=1e-5)
    assert np.linalg.matrix_rank(found[:2, :2]) == 2


@pytest.mark.parametrize("name", OWN)
def test_the_likelihood_of_states_is_that_of_independent_normals(name: str) -> None:
    kind = kind_of(name)
    model = Model({name: kind})
    state = state_of(kind, 30.0, 25.0, 6.0, -4.0)
    states = (
        state + np.random.default_rng(1).normal(0.0, 3.0, (7, len(state))) * np.array([1, 1, 1, 1, 0.1])[: len(state)]
    )
    heard = reports(kind, kind.h(state, PLACES) * 1.01)
    sd = np.array([noise_sd(model, heard, one) for one in states])
    exact = norm.logpdf(heard.values[:, 0], expected(model, states, heard), sd).sum(axis=1)
    found = log_likelihood(model, states, heard)
    assert found - found[0] == pytest.approx(exact - exact[0], abs=1e-9)
    assert jacobians(model, state, heard).shape == (4, len(state))


def test_several_targets() -> None:
    """Distance and level are those of the nearest, energies add up, that of a target out of range, too."""
    paths = [Path.of([(0.0, x, 0.0, 0.0, 0.0), (9.0, x, 0.0, 0.0, 0.0)]) for x in (20.0, -50.0, 400.0)]
    scene, alone = Scene(tuple(paths)), [Scene((path,)) for path in paths]
    for name in ("range", "rss"):
        kind = kind_of(name)
        both, near = (kind.simulate(one, NS, (0.0, 0.0), (0.7,)) for one in (scene, alone[0]))
        assert both == near is not None
    kind = kind_of("energy", relative=0.3)
    every = kind.simulate(scene, NS, (0.0, 0.0), (0.0,))
    assert every is not None
    assert every[0] == pytest.approx(sum(1e5 * x**-2.0929 for x in (20.0, 50.0, 400.0)), rel=1e-12)
    noisy = kind.simulate(scene, NS, (0.0, 0.0), (1.0,))
    assert noisy is not None
    assert noisy[0] - every[0] == pytest.approx(hypot(0.9298, 0.3 * every[0]), rel=1e-12)
    assert kind.simulate(alone[2], NS, (0.0, 0.0), (0.0,)) is None


def test_trackers_know_the_emitted_energy_but_for_its_logarithm() -> None:
    (unknown,) = kind_of("energy", emitted=500.0, emitted_sd=0.3, emitted_walk=0.05).unknowns
    assert unknown == Unknown("log_emitted", 0.3, 0.05, log(500.0))
