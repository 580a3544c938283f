"""Where a camera has to look to meet a target: exact answers, and searches over many instants for the rest."""

from __future__ import annotations

from math import atan, degrees, hypot, inf, isfinite, nan, radians, tan

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from trackfield.models.pointing import (
    AHEAD,
    AIM_M,
    EVI_D30,
    Aim,
    Direction,
    Motion,
    Mount,
    Optics,
    in_reach,
    in_view,
    intercept,
    project,
    slew_s,
    towards,
)

LEVEL = Mount(0.0, 0.0, AIM_M, 90.0)
"""At the height of what it looks at, so that tilt is 0; it looks north."""
POLE = Mount(30.0, -25.0, 2.0, 140.0)


def _at(start: tuple[float, float, float, float], age_s: float) -> tuple[float, float]:
    return start[0] + start[2] * age_s, start[1] + start[3] * age_s


def _could(mount: Mount, look: Direction, at: tuple[float, float], seconds: float, spare_deg: float) -> bool:
    """Whether the camera, with ``spare_deg`` left of each limit, can look at a place after turning so long."""
    to = towards(mount, *at)
    if hypot(at[0] - mount.x_m, at[1] - mount.y_m) < 1e-5:  # the place of the camera has no direction
        return False
    inside = abs(to.pan) <= EVI_D30.pan - spare_deg and abs(to.tilt) <= EVI_D30.tilt - spare_deg
    turned = abs(to.pan - look.pan) + spare_deg <= EVI_D30.pan_s * seconds
    return inside and turned and abs(to.tilt - look.tilt) + spare_deg <= EVI_D30.tilt_s * seconds


# --- turning ----------------------------------------------------------------------------------------------------------


def test_each_axis_turns_at_its_own_speed_and_rests() -> None:
    motion = Motion(Direction(-10.0, 5.0), Direction(70.0, -20.0), 80.0, 50.0)
    assert motion.lasts_s == 1.0
    assert motion.at(-1.0) == motion.at(0.0) == motion.start
    assert motion.at(0.25) == Direction(10.0, -7.5)
    assert motion.at(0.5) == Direction(30.0, -20.0)
    assert motion.at(1.0) == motion.at(inf) == motion.to


def test_an_axis_without_speed_never_gets_there() -> None:
    assert Motion(AHEAD, Direction(1.0, 0.0), 0.0, 50.0).lasts_s == inf
    assert Motion(AHEAD, Direction(1.0, 0.0), 0.0, 50.0).at(10.0) == AHEAD
    assert Motion(AHEAD, AHEAD, 0.0, 0.0).lasts_s == 0.0


_pans, _tilts = st.floats(-100, 100), st.floats(-25, 25)
_directions = st.builds(Direction, _pans, _tilts)


@given(_directions, _directions, st.floats(3.3, 80), st.floats(2.5, 50), st.floats(0, 1))
def test_a_turn_stays_between_its_ends_and_ends_when_it_says(
    start: Direction, to: Direction, pan_s: float, tilt_s: float, share: float
) -> None:
    motion = Motion(start, to, pan_s, tilt_s)
    look = motion.at(share * motion.lasts_s)
    for axis in (0, 1):
        assert min(start[axis], to[axis]) <= look[axis] <= max(start[axis], to[axis])
        assert abs(look[axis] - start[axis]) <= (pan_s, tilt_s)[axis] * share * motion.lasts_s + 1e-9
    assert motion.at(motion.lasts_s * (1 + 1e-12) + 1e-12) == to


# --- exact answers ----------------------------------------------------------------------------------------------------


def test_who_comes_straight_ahead_is_met_at_once() -> None:
    assert intercept(LEVEL, AHEAD, (0.0, 100.0, 0.0, -10.0), 2.0, 0.3) == Aim(0.3, 0.0, 77.0, AHEAD)


def test_who_stands_is_met_when_the_camera_has_turned() -> None:
    aim = intercept(LEVEL, Direction(-30.0, 0.0), (50.0, 50.0, 0.0, 0.0), 9.0, 0.25)
    assert aim is not None
    assert aim.to.pan == pytest.approx(45.0)
    assert aim.after_s == pytest.approx(0.25 + 75 / 80)
    assert (aim.x_m, aim.y_m) == (50.0, 50.0)


def test_tilt_may_take_longer_than_pan() -> None:
    high = Mount(0.0, 0.0, AIM_M + 40.0, 90.0)
    aim = intercept(high, AHEAD, (0.0, 100.0, 0.0, 0.0), 0.0)
    assert aim is not None
    assert aim.to.tilt == pytest.approx(-degrees(atan(0.4)))
    assert aim.after_s == pytest.approx(degrees(atan(0.4)) / 50)


def test_a_crossing_target_is_met_where_its_pan_is_what_was_turned() -> None:
    """A target at pan ``atan(v t / d)`` of a camera that turns by ``w t``, from pan ``-p``: atan(v t / d) + p = w t."""
    start, look = (0.0, 40.0, 20.0, 0.0), Direction(-60.0, 0.0)
    aim = intercept(LEVEL, look, start, 0.0)
    assert aim is not None
    assert tan(radians(80.0 * aim.after_s - 60.0)) == pytest.approx(20.0 * aim.after_s / 40.0, rel=1e-9)
    assert aim.after_s == pytest.approx(slew_s(look, aim.to))


def test_who_comes_into_reach_later_is_met_at_the_edge_of_reach() -> None:
    """East of the camera, 100 deg right of north: it enters reach on the ray at that angle, long after the turn."""
    start = (80.0, -80.0, 0.0, 5.0)
    aim = intercept(LEVEL, AHEAD, start, 0.0)
    assert aim is not None
    assert aim.to.pan == pytest.approx(100.0)
    assert in_reach(aim.to)
    assert aim.y_m == pytest.approx(-80.0 * tan(radians(10.0)), rel=1e-6)
    assert intercept(LEVEL, AHEAD, start, 0.0, horizon_s=aim.after_s - 1e-3) is None


def test_who_passes_right_beneath_is_met_beyond() -> None:
    """Too steep at first: tilt comes within 25 deg where the distance is height / tan(25 deg)."""
    high = Mount(0.0, 0.0, AIM_M + 10.0, 90.0)
    aim = intercept(high, AHEAD, (0.0, 0.0, 0.0, 10.0), 0.0)
    assert aim is not None
    assert (aim.x_m, aim.y_m) == pytest.approx((0.0, 10.0 / tan(radians(25.0))))
    assert aim.to == pytest.approx((0.0, -25.0))


def test_who_runs_through_the_camera_is_met_on_the_far_side() -> None:
    """Towards the camera from behind: out of reach until it has passed through its place."""
    aim = intercept(LEVEL, AHEAD, (0.0, -20.0, 0.0, 10.0), 0.0)
    assert aim is not None
    assert aim.after_s == pytest.approx(2.0, abs=1e-6)
    assert aim.to.pan == pytest.approx(0.0, abs=1e-3)


def test_who_stays_behind_is_never_met() -> None:
    assert intercept(LEVEL, AHEAD, (0.0, -50.0, 0.0, 0.0), 0.0) is None
    assert intercept(LEVEL, AHEAD, (5.0, -50.0, 0.0, -10.0), 0.0) is None


def test_who_is_at_the_place_of_the_camera() -> None:
    above = Mount(0.0, 0.0, 2.0, 0.0)
    assert intercept(above, AHEAD, (0.0, 0.0, 0.0, 0.0), 0.0) is None
    assert not in_reach(towards(above, 0.0, 0.0))
    assert isfinite(towards(LEVEL, 0.0, 0.0).pan)


def test_nothing_is_met_beyond_the_horizon() -> None:
    assert intercept(LEVEL, AHEAD, (0.0, 100.0, 0.0, 0.0), 0.0, lead_s=2.0, horizon_s=1.0) is None
    assert intercept(LEVEL, AHEAD, (0.0, 100.0, 0.0, 0.0), 0.0, lead_s=2.0, horizon_s=2.0) is not None


@pytest.mark.parametrize("wrong", [nan, inf, -inf])
def test_what_is_not_finite_is_not_met(wrong: float) -> None:
    right = (30.0, 40.0, 5.0, 5.0)
    for place in range(4):
        start = (*right[:place], wrong, *right[place + 1 :])
        assert intercept(LEVEL, AHEAD, start, 0.0) is None
    assert intercept(LEVEL, AHEAD, right, wrong) is None
    assert intercept(LEVEL, AHEAD, right, 0.0, wrong) is None
    assert intercept(LEVEL, Direction(wrong, 0.0), right, 0.0) is None
    assert intercept(Mount(wrong, 0.0, 2.0, 0.0), AHEAD, right, 0.0) is None
    assert intercept(Mount(0.0, 0.0, 2.0, wrong), AHEAD, right, 0.0) is None


# --- any target -------------------------------------------------------------------------------------------------------

_places, _speeds = st.floats(-150, 150), st.floats(-40, 40)
_starts = st.tuples(_places, _places, _speeds, _speeds)
_mounts = st.builds(Mount, _places, _places, st.floats(0.2, 30), st.floats(-360, 360))


@given(_mounts, _directions, _starts, st.floats(-2, 5), st.floats(0, 1))
@example(POLE, AHEAD, (0.0, 0.0, 9.5, -9.5), 1.0, 0.05)
@example(LEVEL, AHEAD, (-50.0, -10.0, 30.0, 0.0), 0.0, 0.0)
@example(Mount(0.0, 0.0, 1.0, 0.0), AHEAD, (0.0, 0.0, 0.0, 1.0), 0.0, 0.0)
@example(Mount(0.0, 0.0, 1.0, 0.0), AHEAD, (0.0, 0.0, 0.0, 0.01), 0.0, 0.0)
@example(Mount(0.0, 0.0, 1.0, 0.0), AHEAD, (3e-7, 0.0, 0.0, 1.0), 0.0, 0.0)
def test_the_camera_is_there_in_time_and_no_earlier_instant_would_do(
    mount: Mount, look: Direction, start: tuple[float, float, float, float], age_s: float, lead_s: float
) -> None:
    aim = intercept(mount, look, start, age_s, lead_s)
    last = 30.0 if aim is None else aim.after_s
    if aim is not None:
        assert in_reach(aim.to)
        assert lead_s <= aim.after_s <= 30.0
        assert (aim.x_m, aim.y_m) == pytest.approx(_at(start, age_s + aim.after_s), abs=1e-9)
        assert aim.to == pytest.approx(towards(mount, aim.x_m, aim.y_m), abs=1e-6)
        assert lead_s + slew_s(look, aim.to) <= aim.after_s + 1e-6
        assert in_view(mount, Motion(look, aim.to, 80.0, 50.0).at(aim.after_s - lead_s + 1e-6), aim.x_m, aim.y_m)
    instants = [lead_s + (last - lead_s) * step / 1000 for step in range(1001)]
    early = [at for at in instants if at < last - 1e-6 or aim is None]
    assert not [at for at in early if _could(mount, look, _at(start, age_s + at), at - lead_s, spare_deg=1e-4)]


@given(_mounts, _directions, st.tuples(_places, _places), st.floats(0, 9), st.floats(0, 1))
def test_who_stands_is_met_if_within_reach(
    mount: Mount, look: Direction, place: tuple[float, float], age_s: float, lead_s: float
) -> None:
    to = towards(mount, *place)
    assume(hypot(place[0] - mount.x_m, place[1] - mount.y_m) > 1e-5)
    assume(abs(abs(to.pan) - 100) > 1e-5 and abs(abs(to.tilt) - 25) > 1e-5)
    aim = intercept(mount, look, (*place, 0.0, 0.0), age_s, lead_s)
    assert (aim is not None) == in_reach(to)
    assert aim is None or aim.after_s == pytest.approx(lead_s + slew_s(look, to))


_any = st.floats(allow_nan=False, allow_infinity=False)


@given(st.builds(Mount, _any, _any, _any, _any), st.builds(Direction, _any, _any), st.tuples(*[_any] * 4), _any, _any)
def test_no_finite_input_raises(
    mount: Mount, look: Direction, start: tuple[float, float, float, float], age_s: float, lead_s: float
) -> None:
    aim = intercept(mount, look, start, age_s, lead_s)
    assert aim is None or (in_reach(aim.to) and all(map(isfinite, aim.to)))
    project(mount, look, start[0], start[1], start[2])
    in_view(mount, look, start[0], start[1])


@given(_mounts, _starts, st.floats(0, 1))
def test_turning_the_mount_turns_pan_alone(
    mount: Mount, start: tuple[float, float, float, float], lead_s: float
) -> None:
    """A camera that stands 20 deg further left and looks 20 deg further right does the same."""
    wide = Optics(pan=179.0, tilt=25.0, pan_s=80.0, tilt_s=50.0, wide=48.8, width=640, height=480)
    one = intercept(mount, Direction(10.0, 0.0), start, 0.0, lead_s, optics=wide)
    turned = Mount(mount.x_m, mount.y_m, mount.z_m, mount.heading_deg + 20.0)
    two = intercept(turned, Direction(30.0, 0.0), start, 0.0, lead_s, optics=wide)
    assume(one is not None and two is not None)
    assert one is not None and two is not None
    assume(abs(one.to.pan) < 150.0 and abs(two.to.pan) < 150.0)
    assert two.after_s == pytest.approx(one.after_s, abs=1e-6)
    assert two.to.pan == pytest.approx(one.to.pan + 20.0, abs=1e-3)
