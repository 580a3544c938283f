"""Jumps of a recording are found, and what vehicles do is none; errors and NEES leave jumps out."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path as FilePath

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from launcher.plan.prepare import load, planned, remarks
from launcher.record.metrics import tracker_metrics
from tests.simulated import simulated
from tests.zhai_field import SCENARIOS
from trackfield.world.jumps import MOST_M_S2, _judged, jumps
from trackfield.world.tracks import path_through, read_track


def found(t, xy):
    """The intervals that are jumps, by their numbers; there are no gaps."""
    return np.flatnonzero(jumps(np.asarray(t, float), np.asarray(xy, float), np.zeros(len(t) - 1, bool))).tolist()


def noisy(xy, sd=0.3, seed=0):
    return xy + sd * np.random.default_rng(seed).standard_normal(xy.shape)


def straight(steps=60, speed=8.0):
    return np.column_stack((speed * np.arange(steps), np.zeros(steps)))


# --- what is one ---


@pytest.mark.parametrize("sd", [0.0, 0.3])
@pytest.mark.parametrize("way", [(12.0, 0.0), (-12.0, 0.0), (0.0, 12.0)])
def test_a_receiver_that_corrects_itself_jumps_once(sd, way):
    xy = noisy(straight(), sd)
    xy[30:] += way
    assert found(range(60), xy) == [29]


def test_a_single_bad_fix_is_off_before_and_after():
    xy = noisy(straight())
    xy[30] += (0.0, 12.0)
    assert found(range(60), xy) == [29, 30]


def test_each_of_several_is_found():
    xy = noisy(straight(100))
    for begin, size in ((20, 9.0), (50, -15.0), (53, 9.0), (80, 200.0)):
        xy[begin + 1 :, 1] += size
    assert found(range(100), xy) == [20, 50, 53, 80]


def test_a_gap_says_nothing_of_what_lies_beside_it():
    t, xy = np.append(np.arange(30.0), np.arange(50.0, 80.0)), np.concatenate((straight(30), straight(30) + 500.0))
    gap = np.diff(t) > 5.0
    assert not jumps(t, xy, gap).any()
    xy[45:] += 20.0
    assert np.flatnonzero(jumps(t, xy, gap)).tolist() == [44]


@pytest.mark.parametrize("sd", [0.0, 0.3])
@pytest.mark.parametrize("begin", [0, 1, 2, 56, 57, 58])
def test_a_jump_at_an_end_is_told_from_one_beside_it(sd, begin):
    xy = noisy(straight(), sd)
    xy[begin + 1 :] += (0.0, 12.0)
    assert found(range(60), xy) == [begin]


def test_three_fixes_do_not_say():
    assert found(range(3), [(0, 0), (40, 0), (41, 0)]) == []


def test_what_is_usual_in_a_recording_does_not_stand_out():
    """Fixes that are all off by 10 m, each second: no vehicle moves like that, but none of them is to blame."""
    xy = noisy(straight(500), 10.0)
    needed = _judged(np.arange(500.0), xy, np.zeros(499, bool), np.arange(499)).needed
    assert np.nanmedian(needed) > MOST_M_S2
    assert found(range(500), xy) == []  # by chance once in 130 such recordings


def test_ten_fixes_a_second_that_are_off_by_centimetres_do_not_jump():
    t = np.arange(300) / 10.0
    xy = np.column_stack((1.4 * t, 0.02 * np.sin(9.0 * t)))
    xy[150:, 1] += 0.3
    assert found(t, xy) == []
    xy[150:, 1] += 3.0
    assert found(t, xy) == [149]


# --- what is none ---


@pytest.mark.parametrize("every", [1, 2, 5])
@pytest.mark.parametrize("name", SCENARIOS)
def test_the_papers_targets_turn_and_speed_up(name, every):
    states = SCENARIOS[name](np.random.default_rng(0))[::every]
    assert found(np.arange(len(states)) * every, states[:, :2]) == []


@pytest.mark.parametrize("brakes", [2.0, 5.0, 9.0])
@pytest.mark.parametrize("phase", np.arange(0.0, 1.0, 0.1))
def test_a_bus_brakes_to_a_stop_and_leaves(brakes, phase):
    t = np.arange(40.0)
    halt = 15.0 / brakes
    since = np.clip(t - 10.0 - phase, 0.0, halt)
    away = np.clip(t - 25.0 - phase, 0.0, None)
    x = 15.0 * np.minimum(t, 10.0 + phase) + 15.0 * since - brakes * since**2 / 2.0 + 0.6 * away**2
    assert found(t, np.column_stack((x, np.zeros(40)))) == []


@pytest.mark.parametrize(
    ("speed", "deg_s", "every"), [(110.0, 5.0, 7), (60.0, 6.0, 8), (12.0, 23.0, 1), (8.0, 30.0, 2)]
)
def test_turns_of_aircraft_and_cars(speed, deg_s, every):
    """Half a turn, in and out at once; at 5 degrees a second and 110 m/s a bank of 44 degrees."""
    fine = np.arange(0.0, 200.0, 0.01)
    heading = np.clip(np.radians(deg_s) * (fine - 71.3), 0.0, np.pi)
    xy = np.cumsum(0.01 * speed * np.column_stack((np.cos(heading), np.sin(heading))), axis=0)[:: 100 * every]
    assert found(every * np.arange(len(xy)), xy) == []


@given(
    st.lists(st.tuples(st.floats(-1, 1), st.floats(0, 2 * np.pi)), min_size=40, max_size=40),
    st.lists(st.sampled_from([0.25, 0.5, 1.0, 2.0, 4.0]), min_size=5, max_size=12),
)
def test_no_motion_needs_more_than_its_own_acceleration(pushes, intervals):
    """Any acceleration up to ``MOST_M_S2``, new each quarter of a second, seen at any times."""
    push = np.array([(MOST_M_S2 * size * np.cos(way), MOST_M_S2 * size * np.sin(way)) for size, way in pushes] * 2)
    v = np.concatenate((np.zeros((1, 2)), np.cumsum(0.25 * push, axis=0)))
    x = np.concatenate((np.zeros((1, 2)), np.cumsum(0.25 * (v[1:] + v[:-1]) / 2.0, axis=0)))
    at = np.append(0, np.cumsum(np.array(intervals) * 4)).astype(int)
    at = at[at < len(x)]
    kept = np.arange(len(at) - 1)
    for left in (kept, np.delete(kept, len(kept) // 2)):
        needed = _judged(0.25 * at, x[at], np.zeros(len(at) - 1, bool), left).needed
        assert not (needed > MOST_M_S2 * (1.0 + 1e-9)).any()


def test_full_acceleration_forth_and_back_needs_all_of_it():
    """1 m/s^2 for one and a half intervals, and -1 for as long: mean speeds of 0.5, 1.25 and 0.5 m/s."""
    x = np.array([0.0, 0.5, 1.75, 2.25])
    needed = _judged(np.arange(4.0), np.column_stack((x, 0.0 * x)), np.zeros(3, bool), np.arange(3)).needed
    assert needed[1] == pytest.approx(1.0)


# --- what comes of it ---


def test_the_path_is_straight_in_a_jump_and_its_velocity_beside_it_is_that_of_the_target():
    xy = straight()
    xy[30:] += (0.0, 12.0)
    path = path_through(np.arange(60.0), xy)
    assert (path.gaps, path.jumps) == ((), ((29.0, 30.0),))
    assert path.at(28.5) == pytest.approx((228.0, 0.0, 8.0, 0.0))
    assert path.at(29.5) == pytest.approx((236.0, 6.0, 8.0, 12.0))
    assert path.at(30.0) == pytest.approx((240.0, 12.0, 8.0, 0.0))
    assert [path.interpolated(t) for t in (28.9, 29.0, 29.5, 30.0, 30.1)] == [False, True, True, True, False]


def ride(folder: FilePath, jump_m: float) -> FilePath:
    file, xy = folder / "ride.csv", noisy(straight(60), 0.2)
    xy[30:, 1] += jump_m
    file.write_text("t_s,x,y\n" + "".join(f"{t},{x},{y}\n" for t, (x, y) in enumerate(xy)))
    return file


def test_steps_in_a_jump_are_told_and_not_judged(tmp_path: FilePath):
    metrics = {}
    for jump_m in (0.0, 30.0):
        plan = planned(load("bus", seed=1, target=ride(tmp_path, jump_m), settings=['fusion.trackers=["imm-ukf"]']))
        said = remarks(plan)
        rows = simulated(plan)[1]
        metrics[jump_m] = tracker_metrics(plan, rows)["imm-ukf"]
        if not jump_m:
            assert said == []
            continue
        assert said == [
            "2 of 59 steps lie where the recording jumps, as no target moves (at 29.0 s): "
            "headline errors leave these steps out"
        ]
        assert [row.t_ns // 10**9 for row in rows if row.interpolated] == [29, 30]
        assert plan.info.truths[0].gaps == ((29.0, 30.0),)
    assert metrics[30.0]["gap"]["steps"] == 2
    assert metrics[30.0]["steps"] == metrics[0.0]["steps"] - 2


# --- recordings ---


def test_a_real_bus_jumps_three_times_in_half_an_hour(data_file: Callable[[str], FilePath]):
    path = read_track(data_file("bus_304.gpx"))
    assert path.jumps == ((614.0, 615.0), (684.0, 685.0), (1083.0, 1084.0))
    for begin, end in path.jumps:  # a speed that neither neighbour has
        before, at, after = (
            np.hypot(*np.subtract(path.at(b)[:2], path.at(a)[:2]))
            for a, b in pairwise((begin - 1, begin, end, end + 1))
        )
        assert at > before + 3.5
        assert at > after + 3.5
    assert read_track(data_file("bus_304.gpx"), "07:57", "07:58").jumps == ((13.0 + 1.0, 15.0),)


def test_a_real_flight_turns_and_its_times_are_off_once(data_file: Callable[[str], FilePath]):
    assert read_track(data_file("aircraft_survey.csv")).jumps == ((15973.0, 15980.0),)


def test_the_packaged_ride_has_none():
    assert planned(load("bus")).paths["target"].jumps == ()
