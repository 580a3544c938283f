"""Curved paths through the raw reports of several events."""

import numpy as np

from tests.passes import PENTAGON, arcs, heard
from tests.solvers import curved, success
from trackfield.filters.passes.hermite import Spline, hermite
from trackfield.filters.passes.solve import solve
from trackfield.filters.passes.types import Passes, Solved


def fixed(field, **options):
    """The fixes of those paths that have one of each event, and the reports of these; a straight path may fit badly."""
    fixes = solve("ml", field.passes, gate=200.0, **options)
    all_of = (fixes.reason == 0).all(axis=1)
    return Passes(*(part[all_of] for part in field.passes[:-1]), 0.0), Solved(*(part[all_of] for part in fixes))


def instants(passes, number=60):
    """(N, number) from the first report to the last."""
    first, last = np.nanmin(passes.times_s, axis=(1, 2)), np.nanmax(passes.times_s, axis=(1, 2))
    return first[:, None] + (last - first)[:, None] * np.linspace(0.0, 1.0, number)


def straight(fixes, times):
    """The places (N, M, 2) by the fix that is next in time."""
    near = np.abs(times[..., None] - fixes.time_s[:, None]).argmin(axis=-1)
    mean = np.take_along_axis(fixes.mean, near[..., None], axis=1)
    return mean[..., :2] + mean[..., 2:] * (times - np.take_along_axis(fixes.time_s, near, axis=1))[..., None]


def test_a_spline_has_its_knots_and_is_smooth():
    times = np.array([0.0, 4.0, 9.0])
    states = np.array([[0.0, 0.0, 10.0, 0.0], [30.0, 20.0, 5.0, 9.0], [40.0, 60.0, 0.0, 11.0]])
    path = Spline(times, states, np.zeros((3, 4, 4)), np.bool_(True))
    np.testing.assert_allclose(path.at(times), states, atol=1e-12)
    at = np.linspace(-2.0, 11.0, 53)
    slopes = (path.at(at + 1e-6) - path.at(at - 1e-6)) / 2e-6
    np.testing.assert_allclose(slopes[:, :2], path.at(at)[:, 2:], atol=1e-6)


def test_a_straight_path_stays_straight():
    rng = np.random.default_rng(2)
    truth = np.array([[0.0, 3.0, 12.0, 1.0]])
    places = 20.0 * PENTAGON + np.array([[0.0, 0.0], [60.0, 10.0], [120.0, 12.0]])[:, None]
    times, d = (part.reshape(1, 3, 5) for part in heard(truth, np.array([50.0]), places.reshape(1, 15, 2)))
    full = np.ones((1, 3, 5))
    passes = Passes(places[None], times, 1.0 / d, 0.1 * full, 0.1 * full)
    path = hermite(passes, solve("ml", passes))
    assert path.converged.all()
    at = rng.uniform(48.0, 62.0, (1, 20))
    expected = np.concatenate(
        (truth[0, :2] + truth[0, 2:] * (at[0, :, None] - 50.0), np.tile(truth[0, 2:], (20, 1))), axis=1
    )
    np.testing.assert_allclose(path.at(at)[0], expected, atol=0.02)


def test_an_arc_is_followed_better_than_by_straight_fixes():
    """R = 100 m; an independent prototype comes from 1.38 m to .81 m."""
    field = arcs(150)
    passes, fixes = fixed(field)
    path, times = hermite(passes, fixes), instants(passes)
    assert path.converged.mean() > 0.95
    off = field.off(straight(fixes, times)).mean(), np.nanmean(field.off(path.at(times)[..., :2]))
    assert off[1] < 0.81 / 1.38 * off[0]
    assert off[1] < 0.81


def test_knots_are_as_uncertain_as_they_say():
    """Inner knots are off the circle by N(0, n^T C n), but where a straight fix began on the wrong side of a sensor.

    chi^2 has the median .455; its estimate from 250 knots has an sd of .07.
    """
    field = arcs(200, seed=3)
    path = hermite(*fixed(field))
    place = path.states[:, 1:-1, :2]
    n = place / np.linalg.norm(place, axis=-1, keepdims=True)
    sd = np.sqrt(np.einsum("nei,neij,nej->ne", n, path.covariance[:, 1:-1, :2, :2], n))
    off = (np.linalg.norm(place, axis=-1) - field.radius_m) / sd
    assert 0.25 < np.nanmedian(np.square(off)) < 0.75
    assert np.nanmean(np.square(off) > 9.0) < 0.06


def test_without_a_fix_of_each_event_there_is_no_path():
    field = arcs(3)
    fixes = solve("ml", field.passes, gate=200.0)
    missing = fixes._replace(mean=fixes.mean * np.nan, time_s=fixes.time_s * np.nan)
    path = hermite(field.passes, missing)
    assert not path.converged.any() and np.isnan(path.states).all()


def test_padding_and_batches_change_nothing():
    field = arcs(4, seed=5)
    passes, fixes = fixed(field)
    padded = Passes(
        *(
            np.pad(part, [(0, 0), (0, 0), (0, 1)] + [(0, 0)] * (part.ndim - 3), constant_values=np.nan)
            for part in passes[:-1]
        ),
        0.0,
    )
    wide = fixes._replace(used=np.pad(fixes.used, [(0, 0), (0, 0), (0, 1)]))
    together, among = hermite(passes, fixes), hermite(padded, wide)
    np.testing.assert_allclose(among.states, together.states, rtol=1e-6)
    for k in range(len(passes.times_s)):
        alone = hermite(Passes(*(part[k] for part in passes[:-1]), 0.0), Solved(*(part[k] for part in fixes)))
        np.testing.assert_allclose(alone.states, together.states[k], rtol=1e-6)


def test_the_delay_of_sound_is_taken_off():
    """Without it the path is late, by what 10 m of sound are."""
    field = arcs(60, seed=6)
    passes, fixes = fixed(field)
    path, deaf = hermite(passes, fixes), hermite(passes, fixes, sound_m_s=1e9)
    along = np.sum((deaf.states - path.states)[..., :2] * path.states[..., 2:], axis=-1)
    late_s = np.nanmean(along / np.square(path.states[..., 2:]).sum(axis=-1))
    assert -0.06 < late_s < -0.01


def test_the_tables_say_what_is_not_told_and_what_is_left_out():
    """Those of docs/solvers.md: CPA without the sides, and how many of the events and arcs have a fix."""
    (header, *rows), (every, *table) = success(20), curved(40)
    assert "sides not told" in header
    assert {row.count("|") for row in rows} == {header.count("|")}
    assert every.endswith("% of the events have a fix.\n")
    assert "% of the arcs" in table[0]
