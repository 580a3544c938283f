"""Solvers of passes: exact cases, the bound, and what does not depend on the order, place or number of fields."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.passes import PENTAGON, SOUND, heard, trials
from trackfield.filters.passes.bounds import bound, bound_errors, line_errors
from trackfield.filters.passes.geometry import across, arrivals, line_of, state, state_slopes
from trackfield.filters.passes.likelihood import likelihood
from trackfield.filters.passes.solve import solve
from trackfield.filters.passes.types import (
    AMBIGUOUS,
    FEW,
    IN_LINE,
    LEAST_STRENGTH_SD,
    LEAST_TIME_SD_S,
    NO_PASS,
    REASONS,
    UNCERTAIN,
    Passes,
    event_of,
)
from trackfield.filters.solving.solver import PER_DB
from trackfield.models import passing
from trackfield.wire import registry
from trackfield.wire.passes import CpaReportSds

NAMES = ("ml", "ecpa", "cpa", "plane")


def errors(field, answer):
    return line_errors(answer.mean, field.truth, np.nanmean(field.passes.places, axis=-2))


def rms(values):
    return np.sqrt(np.nanmean(np.square(values), axis=0))


def each(passes, change):
    """The reports with ``change`` made to each array."""
    return Passes(*(change(part) for part in passes[:-1]), passes.place_sd_m)


def ahead(truth, seconds):
    return truth + np.concatenate((truth[:, 2:] * seconds[:, None], 0.0 * truth[:, 2:]), axis=-1)


def test_times_of_a_line_are_those_of_the_target_that_passes():
    field = trials(50, time_sd=0.0)
    line = line_of(field.truth)
    places = field.true_places[0]
    times, d = heard(field.truth, 0.0 * field.time_s, field.true_places)
    np.testing.assert_allclose(arrivals(line, field.true_places, SOUND), times, rtol=0, atol=1e-9)
    np.testing.assert_allclose(passing.times(field.truth, places, SOUND), times, rtol=0, atol=1e-9)
    np.testing.assert_allclose(np.abs(across(line, field.true_places)), d, rtol=0, atol=1e-9)
    np.testing.assert_allclose(line_of(state(line)), line * [0, 1, 1, 1], atol=1e-9)


def test_slopes_of_the_state_are_those_at_a_fixed_time():
    line = line_of(trials(30).truth)

    def at_the_time(moved):
        there = state(moved)
        return ahead(there, line[:, 0] - moved[:, 0])

    numeric = [(at_the_time(line + step) - at_the_time(line - step)) / 2e-6 for step in 1e-6 * np.eye(4)]
    np.testing.assert_allclose(np.stack(numeric, axis=-1), state_slopes(line), rtol=1e-5, atol=1e-4)


@pytest.mark.parametrize("place_error", [0.0, 3.0])
def test_gradient_is_that_of_the_cost(place_error):
    event = event_of(trials(20, place_error_m=place_error).passes)
    at = np.random.default_rng(3).normal([0.0, 0.05, 0.05, 0.0, 7.0], [0.1, 0.02, 0.02, 5.0, 1.0], (20, 5))
    numeric = [
        (likelihood(at + step, event, SOUND).cost - likelihood(at - step, event, SOUND).cost) / 4e-6
        for step in 1e-6 * np.eye(5)
    ]
    gradient = likelihood(at, event, SOUND).gradient
    np.testing.assert_allclose(np.stack(numeric, axis=-1), gradient, rtol=1e-5, atol=1e-5 * np.abs(gradient).max())


def test_a_pass_without_noise_is_found_exactly():
    field = trials(200, time_sd=0.0, strength_sd=0.0)
    answer = solve("ml", field.passes)
    assert (answer.reason == 0).all() and answer.used.all()
    for error in errors(field, answer):
        assert error.max() < 1e-3
    np.testing.assert_allclose(answer.mean, ahead(field.truth, answer.time_s - field.time_s), atol=5e-3)
    away = answer.mean[:, :2] - field.passes.places.mean(axis=1)
    np.testing.assert_allclose((away * answer.mean[:, 2:]).sum(axis=1), 0.0, atol=1e-6)  # nearest to the centroid


def test_likeliest_paths_are_as_near_as_the_bound_allows():
    """Five sensors: within 1.2 of the bound in speed and heading, and in place on average."""
    field = trials(500)
    answer = solve("ml", field.passes)
    off, least = errors(field, answer), bound_errors(field.truth, field.passes)
    fixed = answer.reason == 0
    assert fixed.mean() > 0.9
    for error, limit in zip(off[1:], least[1:], strict=True):
        assert rms(error) < 1.2 * rms(limit[fixed])
    assert np.nanmean(off.location_m) < 1.2 * rms(least.location_m[fixed])


def test_covariances_are_those_of_the_errors():
    """NEES has the mean 4 and, over 1800 fixes, an sd of .07; the covariance is linearised: up to 5 % are allowed."""
    field = trials(2000, seed=4)
    answer = solve("ml", field.passes)
    fixed = answer.reason == 0
    off = (answer.mean - ahead(field.truth, answer.time_s - field.time_s))[fixed]
    nees = np.einsum("ni,ni->n", off, np.linalg.solve(answer.covariance[fixed], off[..., None])[..., 0])
    assert abs(nees.mean() - 4.0) < 0.4
    assert np.mean(nees > 20.0) < 0.005


def test_the_bound_is_the_curvature_of_the_likelihood_without_noise():
    field = trials(10, time_sd=0.1)
    truth = field.truth
    times, d = heard(truth, 0.0 * field.time_s, field.true_places)
    event = event_of(field.passes._replace(times_s=times, strengths=1000.0 / d))
    line = line_of(np.concatenate((truth[:, :2] - event.centroid, truth[:, 2:]), axis=-1))
    line[:, 0] -= event.epoch_s
    at = np.concatenate((line, np.full((10, 1), np.log(1000.0))), axis=-1)
    curvature = [
        (likelihood(at + step, event, SOUND).gradient - likelihood(at - step, event, SOUND).gradient) / 2e-6
        for step in 1e-6 * np.eye(5)
    ]
    slopes = state_slopes(line)
    expected = slopes @ np.linalg.inv(np.stack(curvature, axis=-1))[:, :4, :4] @ np.swapaxes(slopes, -1, -2)
    np.testing.assert_allclose(bound(truth, field.passes), expected, rtol=1e-3, atol=1e-6)


def test_errors_of_lines_compare_their_points_nearest_to_the_centroid():
    truth, centre = np.array([0.0, 0.0, 10.0, 0.0]), np.array([100.0, 5.0])
    off = line_errors(np.array([300.0, 3.0, 12.0, 0.0]), truth, centre)
    assert off.location_m == pytest.approx(3.0) and off.speed_m_s == pytest.approx(2.0)
    assert off.heading_rad == pytest.approx(0.0)
    assert line_errors(-truth, truth, centre).heading_rad == pytest.approx(np.pi)


@pytest.mark.parametrize("name", NAMES)
def test_padding_changes_nothing(name):
    field = trials(20, place_error_m=1.0)
    padded = each(
        field.passes,
        lambda part: np.pad(part, [(0, 0), (0, 2)] + [(0, 0)] * (part.ndim - 2), constant_values=np.nan),
    )
    alone, among = solve(name, field.passes), solve(name, padded)
    assert (alone.reason == among.reason).all() and (alone.reason == 0).any()
    assert (among.used == np.pad(alone.used, [(0, 0), (0, 2)])).all()
    np.testing.assert_allclose(among.mean, alone.mean, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(among.covariance, alone.covariance, rtol=1e-3, atol=1e-5)


@pytest.mark.parametrize("name", NAMES)
def test_many_at_once_are_as_one_at_a_time(name):
    field = trials(24, seed=9)
    together = solve(name, each(field.passes, lambda part: part.reshape(2, 12, *part.shape[1:])))
    assert together.reason.shape == (2, 12) and together.covariance.shape == (2, 12, 4, 4)
    for k in range(24):
        alone = solve(name, each(field.passes, lambda part, k=k: part[k]))
        assert alone.reason == together.reason.ravel()[k]
        assert (alone.used == together.used.reshape(24, -1)[k]).all()
        np.testing.assert_allclose(alone.mean, together.mean.reshape(24, 4)[k], rtol=1e-7)


@pytest.mark.parametrize("name", NAMES)
@given(order=st.permutations(range(5)))
@settings(max_examples=5, deadline=None)
def test_the_order_of_the_sensors_does_not_matter(name, order):
    field = trials(10, time_sd=0.02, seed=3)
    answer, other = solve(name, field.passes), solve(name, each(field.passes, lambda part: part[:, list(order)]))
    assert (answer.reason == other.reason).all() and (answer.used[:, list(order)] == other.used).all()
    np.testing.assert_allclose(other.mean, answer.mean, rtol=1e-4, atol=1e-3)


@pytest.mark.parametrize("name", NAMES)
@given(
    turn=st.floats(0.0, 2.0 * np.pi),
    x=st.floats(-1e4, 1e4),
    y=st.floats(-1e4, 1e4),
    later=st.floats(0.0, 6e4),
    louder=st.floats(-3.0, 3.0),
)
@settings(max_examples=5, deadline=None)
def test_fields_that_are_turned_and_moved_give_the_same_paths(name, turn, x, y, later, louder):
    field = trials(10, time_sd=0.02, seed=3)
    turned = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    moved = field.passes._replace(
        places=field.passes.places @ turned.T + [x, y],
        times_s=field.passes.times_s + later,
        strengths=field.passes.strengths * np.exp(louder),
    )
    answer, other = solve(name, field.passes), solve(name, moved)
    assert (answer.reason == other.reason).all()
    np.testing.assert_allclose(other.time_s, answer.time_s + later, atol=1e-4)
    np.testing.assert_allclose(other.mean[:, :2], answer.mean[:, :2] @ turned.T + [x, y], atol=2e-3)
    np.testing.assert_allclose(other.mean[:, 2:], answer.mean[:, 2:] @ turned.T, atol=2e-3)


@pytest.mark.parametrize("name", NAMES)
def test_the_velocity_is_never_reversed(name):
    field = trials(400, seed=6)
    off = errors(field, solve(name, field.passes))
    assert np.nanmax(off.heading_rad) < np.radians(60.0)


def test_less_known_places_leave_the_path_less_known():
    field = trials(50)
    sharp = solve("ml", field.passes)
    vague = solve("ml", field.passes._replace(place_sd_m=2.0))
    both = (sharp.reason == 0) & (vague.reason == 0)
    assert both.sum() > 30
    traces = [np.trace(one.covariance[both], axis1=-2, axis2=-1) for one in (sharp, vague)]
    assert (traces[1] > traces[0]).mean() > 0.95


def test_four_reports_are_enough():
    """An independent prototype has .87 m, .53 m/s and 1.6 degrees with four."""
    field = trials(500, places=PENTAGON[:4])
    answer = solve("ml", field.passes)
    off = errors(field, answer)
    assert (answer.reason == 0).mean() > 0.75
    assert np.nanmean(off.location_m) < 0.87
    assert np.nanmean(off.speed_m_s) < 0.6
    assert np.degrees(np.nanmean(off.heading_rad)) < 1.6


@pytest.mark.parametrize("count", [0, 1, 2, 3])
@pytest.mark.parametrize("name", NAMES)
def test_too_few_reports_are_refused(name, count):
    answer = solve(name, each(trials(3).passes, lambda part: part[:, :count]))
    assert (answer.reason == FEW).all() and REASONS[FEW] == "too few reports"
    assert np.isnan(answer.mean).all() and not answer.used.any()


@pytest.mark.parametrize("name", NAMES)
def test_an_event_without_any_report_is_refused(name):
    answer = solve(name, each(trials(3).passes, lambda part: np.full_like(part, np.nan)))
    assert (answer.reason == FEW).all()


def test_sensors_in_a_line_leave_the_side_open():
    line = np.stack((np.linspace(-1.0, 1.0, 5), np.zeros(5)), axis=-1)
    field = trials(10, places=line + [0.0, 1e-9] * np.arange(5)[:, None])
    assert (solve("ml", field.passes).reason == IN_LINE).all()


def test_two_paths_that_fit_as_well_are_refused():
    """Along a rectangle: sensors on one side are three times as loud, so the path is 5 m from them, or 10 m beyond.

    The delays of sound do not tell, as a path that is turned a little has the others' times. A fifth sensor does.
    """
    places = np.array([[-20.0, 10.0], [-20.0, -10.0], [20.0, 10.0], [20.0, -10.0], [0.0, 0.0]])
    d, full = np.abs(places[:, 1] - 5.0), np.ones(5)
    passes = Passes(places, places[:, 0] / 13.4 + d / SOUND, 1.0 / d, 0.002 * full, 0.1 * full)
    assert solve("ml", each(passes, lambda part: part[:4])).reason == AMBIGUOUS
    answer = solve("ml", passes)
    assert answer.reason == 0
    np.testing.assert_allclose(answer.mean, [0.0, 5.0, 13.4, 0.0], atol=0.01)


def test_a_late_report_is_left_out():
    field = trials(300)
    times = field.passes.times_s.copy()
    times[:, 2] += 2.0
    answer = solve("ml", field.passes._replace(times_s=times))
    fixed = answer.reason == 0
    assert fixed.mean() > 0.7
    assert (~answer.used[fixed][:, 2]).mean() > 0.99
    assert np.nanmean(errors(field, answer).location_m) < 0.87


def test_a_false_report_is_left_out():
    """A sensor that heard something else: any time within 3 s, any strength."""
    field, rng = trials(300), np.random.default_rng(8)
    times, strengths = field.passes.times_s.copy(), field.passes.strengths.copy()
    times[:, 1] = times.mean(axis=1) + rng.uniform(2.0, 5.0, 300) * rng.choice([-1.0, 1.0], 300)
    strengths[:, 1] *= np.exp(rng.normal(0.0, 0.7, 300))
    answer = solve("ml", field.passes._replace(times_s=times, strengths=strengths))
    fixed = answer.reason == 0
    assert fixed.mean() > 0.7
    assert (~answer.used[fixed][:, 1]).mean() > 0.97


def test_of_a_thousand_passes_the_gate_refuses_about_one():
    """Of 2000, 2 on average: more than 8 in one of 4000 tries."""
    answer = solve("ml", trials(2000, seed=12).passes)
    assert np.sum((answer.reason == NO_PASS) | ~answer.used.all(axis=1) & (answer.reason == 0)) <= 8


def test_random_times_are_no_pass():
    """Any times within 10 s: nearly no five of them fit, and four of five seldom do."""
    rng, number = np.random.default_rng(5), 500
    full = np.ones((number, 5))
    random = Passes(
        np.broadcast_to(20.0 * PENTAGON, (number, 5, 2)),
        rng.uniform(0.0, 10.0, (number, 5)),
        np.exp(rng.normal(0.0, 0.7, (number, 5))),
        0.1 * full,
        0.1 * full,
    )
    answer = solve("ml", random)
    assert answer.used.all(axis=1).mean() < 0.01
    assert (answer.reason == 0).mean() < 0.08
    assert (answer.reason == NO_PASS).mean() > 0.85


def test_times_that_say_little_leave_the_path_uncertain():
    answer = solve("ml", trials(50, time_sd=3.0).passes)
    assert (answer.reason == UNCERTAIN).mean() > 0.8


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("time_sd", "strength_sd"), [(0.0, 0.0), (0.0, 0.1), (0.1, 0.0), (1e-9, 1e-9)])
def test_reports_that_are_said_to_be_exact_give_the_path(name, time_sd, strength_sd):
    field = trials(50, time_sd=0.0, strength_sd=0.0)
    full = np.ones_like(field.passes.times_s)
    said = field.passes._replace(time_sd_s=time_sd * full, strength_sd=strength_sd * full)
    least = said._replace(
        time_sd_s=np.maximum(said.time_sd_s, LEAST_TIME_SD_S),
        strength_sd=np.maximum(said.strength_sd, LEAST_STRENGTH_SD),
    )
    answer = solve(name, said)
    assert (answer.reason == 0).mean() > 0.9
    np.testing.assert_array_equal(answer.mean, solve(name, least).mean)


def test_the_least_noise_is_half_of_what_a_message_tells_apart():
    fields = {one.name: one for one in registry.kind_of_class(CpaReportSds).fields}
    assert fields["early_s"].scaled.resolution / 2 == LEAST_TIME_SD_S
    assert fields["strength_db"].scaled.resolution / 2 * PER_DB == pytest.approx(LEAST_STRENGTH_SD)


def test_an_unknown_solver_is_an_error():
    with pytest.raises(ValueError, match="no solver 'best'; there are cpa, ecpa, ml, plane"):
        solve("best", trials(2).passes)
