"""Whole tracks through the reports of several events, as a base finds them: nearer to a curved path than fixes are."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from math import cos, hypot, sin

import numpy as np
import pytest

from fusion.fixes import Fix, read
from fusion.splines import MOST, Heard, Splines
from launcher.plan.prepare import remarks
from tests.cpa_fields import THREE, plan_of
from tests.ether import ORIGIN_NS, Place
from tests.hearing import BASE, SOUND_M_S, STEP_NS, Line, bank_of, field_of, named, pentagon
from tests.simulated import simulated
from trackfield.filters.passes.solve import solve
from trackfield.filters.types import Gaussian
from trackfield.role import NS, TrackPoint
from trackfield.tracking.bank import Bank
from trackfield.tracking.stored import pack
from trackfield.wire.passes import FixReport
from trackfield.wire.raw import Raw
from trackfield.wire.raw import pack as pack_raw

SPEED = 13.4
TURN_M = 100.0
Path = Callable[[float], tuple[float, float]]


def arc(t_s: float) -> tuple[float, float]:
    """Along a circle of 100 m around (0, 100), from the origin to the east, 2 s after the start."""
    angle = SPEED * (t_s - 2.0) / TURN_M
    return TURN_M * sin(angle), TURN_M * (1.0 - cos(angle))


PLACES = named([place for t_s in (2.0, 6.5, 11.0) for place in pentagon(*arc(t_s))])
NOISE = {"range_m": 60.0, "time_sd_s": 0.1, "strength_sd": 0.1}
"""That of the paper: with less noise reports of a path so curved are refused, as it is not straight."""
BANK = Bank(**{**bank_of(PLACES), "sensing": {"cpa": {"kind": "cpa", "options": NOISE}}})
SPLINES = Splines(BANK)


def heard(path: Path, place: Place, around_s: float) -> tuple[float, float]:
    """When (s) the target is heard to be nearest to a place, and how far (m) it is then."""
    times = np.arange(around_s - 4.0, around_s + 4.0, 1e-3)
    away = [hypot(path(t)[0] - place[0], path(t)[1] - place[1]) for t in times]
    best = int(np.argmin(away))
    return float(times[best]) + away[best] / SOUND_M_S, away[best]


def told(path: Path, cluster: int, around_s: float, *, most: int = 5, number: int = 0, bank: Bank = BANK) -> Fix:
    """What the head of a cluster tells of a pass, half a second after the last report could come."""
    ids = list(bank.positions)[5 * cluster :][:most]
    found = [heard(path, bank.positions[id], around_s) for id in ids]
    step = int(max(t_s for t_s, _ in found) / (STEP_NS / NS)) + 4
    at_s = step * STEP_NS / NS
    rows = [
        Raw(list(bank.positions).index(id), at_s - t_s, -20.0 * float(np.log10(d)), d / SPEED)
        for id, (t_s, d) in zip(ids, found, strict=True)
    ]
    x, y = path(at_s)
    belief = pack(step, None, {"ml": Gaussian(np.array([x, y, SPEED, 0.0]), np.eye(4))})
    return read(FixReport(number, step, 0, belief, pack_raw(rows)), ids[0], bank)


def off_m(points: list[TrackPoint], path: Path) -> list[float]:
    places = [path((point.at_ns - ORIGIN_NS) / NS) for point in points]
    return [hypot(p.mean[0] - x, p.mean[1] - y) for p, (x, y) in zip(points, places, strict=True)]


def events(path: Path = arc) -> tuple[Heard, ...]:
    kept: tuple[Heard, ...] = ()
    for cluster, around_s in enumerate((2.0, 6.5, 11.0)):
        kept = SPLINES.learn(kept, told(path, cluster, around_s))
    return kept


def straight_off_m() -> list[float]:
    """How far the straight fixes are off, each at the steps between its first report and its last."""
    found = list[float]()
    for one in events():
        solved = solve("ml", SPLINES.passes((one,), ORIGIN_NS), sound_m_s=SOUND_M_S)
        t_s, (x, y, vx, vy) = float(solved.time_s[0]), solved.mean[0].tolist()
        times = [at_ns for _, at_ns, *_ in one.rows]
        for step in range(BANK.step_at(min(times)) + 1, BANK.step_at(max(times)) + 1):
            after_s = step * STEP_NS / NS - t_s
            true = arc(step * STEP_NS / NS)
            found.append(hypot(x + vx * after_s - true[0], y + vy * after_s - true[1]))
    return found


def test_it_follows_a_curved_path_nearer_than_the_straight_fixes() -> None:
    points = SPLINES.points(events(), now=40)
    assert {point.tracker for point in points} == {"ml+spline"}
    steps = [point.step for point in points if point.step is not None]
    assert steps == list(range(steps[0], steps[-1] + 1))
    assert (steps[0], steps[-1]) == (2, 24)  # from the first report, at 0.6 s, to the last, at 12.4 s
    assert [point.lag for point in points] == [40 - step for step in steps]
    assert max(off_m(points, arc)) < 0.1
    assert np.mean(straight_off_m()) > 0.5


def test_its_covariance_is_what_the_reports_leave() -> None:
    """Smaller than that of a single fix at the knots, and a sound covariance in between."""
    points = SPLINES.points(events(), now=40)
    for point in points:
        C = np.array(point.covariance).reshape(4, 4)
        assert np.linalg.eigvalsh(C).min() > 0.0
        assert 0.1 < C[0, 0] ** 0.5 < 1.5


def test_of_a_straight_path_it_is_that() -> None:
    def straight(t_s: float) -> tuple[float, float]:
        return SPEED * (t_s - 2.0), 1.0

    places = [straight(t_s) for t_s in (2.0, 6.5, 11.0)]
    here = named([place for x, y in places for place in pentagon(x, y + 2.0)])
    bank = Bank(**{**bank_of(here), "sensing": {"cpa": {"kind": "cpa", "options": NOISE}}})
    splines, kept = Splines(bank), ()
    for cluster, around_s in enumerate((2.0, 6.5, 11.0)):
        kept = splines.learn(kept, told(straight, cluster, around_s, bank=bank))
    assert max(off_m(splines.points(kept, 40), straight)) < 0.05


def test_events_are_solved_with_the_noise_that_the_trackers_take() -> None:
    """It grows with the distance: near sensors are exact, and one time for all would leave far ones many sds off."""
    law = {"time_sd_s": 0.02, "time_at_m": 3.0, "distance_power": 2.0, "speed_power": 1.0, "place_sd_m": 0.5}
    bank = Bank(**{**bank_of(PLACES), "sensing": {"cpa": {"kind": "cpa", "options": {**NOISE, **law}}}})
    splines, kept = Splines(bank), events()
    assert max(off_m(splines.points(kept, 40), arc)) < 0.5
    given = splines.passes(kept, ORIGIN_NS)
    taken, solved = splines.solvers["ml"].solved(bank.model, given)
    assert (solved.reason == 0).all()
    for i, one in enumerate(kept):
        alone, fix = splines.solvers["ml"].solved(bank.model, splines.passes((one,), ORIGIN_NS))
        assert np.array_equal(alone.time_sd_s[0], taken.time_sd_s[i], equal_nan=True)
        assert np.allclose(fix.mean[0], solved.mean[i])
    assert np.nanmax(taken.time_sd_s) > 5.0 * np.nanmin(taken.time_sd_s) > 0.0


def test_a_single_event_has_none() -> None:
    assert SPLINES.points(events()[:1], 40) == []
    assert SPLINES.points((), 40) == []


def test_points_are_of_the_head_whose_event_was_before() -> None:
    points = SPLINES.points(events(), 40)
    assert [point.origin for point in points if point.step in (2, 8, 16, 24)] == ["n00", "n00", "n05", "n10"]


def test_of_events_that_share_reports_the_one_with_more_counts() -> None:
    few, more = told(arc, 0, 2.0, most=4), told(arc, 0, 2.0, number=1)
    for order in ((few, more), (more, few)):
        kept = SPLINES.learn(SPLINES.learn((), order[0]), order[1])
        assert [len(one.rows) for one in kept] == [5]


def test_an_event_without_a_fix_is_none() -> None:
    fix = told(arc, 0, 2.0)
    refused = read(FixReport(0, fix.step, 1, b"", pack_raw(fix.raw)), "n00", BANK)
    assert SPLINES.learn((), refused) == ()


def test_so_many_are_kept() -> None:
    fix, kept = told(arc, 0, 2.0), ()
    for number in range(MOST + 20):
        step = fix.step + 40 * number
        belief = pack(step, None, {"ml": fix.beliefs["ml"]})
        later = FixReport(number, step, 0, belief, pack_raw(fix.raw))
        kept = SPLINES.learn(kept, read(later, "n00", BANK))
    assert len(kept) == MOST
    assert kept[-1].step == fix.step + 40 * (MOST + 19)


def test_another_target_begins_another_track() -> None:
    """It comes from the other side: no path of one target passes both."""

    def back(t_s: float) -> tuple[float, float]:
        return arc(60.0 - t_s)

    kept = events()
    for cluster, around_s in ((2, 49.0), (1, 53.5), (0, 58.0)):
        kept = SPLINES.learn(kept, told(back, cluster, around_s))
    points = SPLINES.points(kept, 200)
    gaps = [b - a for a, b in pairwise(point.step or 0 for point in points) if b - a != 1]
    assert len(gaps) == 1
    first = [point for point in points if (point.step or 0) < 60]
    assert max(off_m(first, arc)) < 0.1
    assert max(off_m(points[len(first) :], back)) < 0.1


# --- at the base ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("last_step", [0, 50])
def test_a_base_publishes_it_when_the_track_has_ended_or_the_run(last_step: int) -> None:
    places = [place for number in range(3) for place in pentagon(60.0 * number)]
    line = Line(3.0, 2.0, 90.0, at_s=8.0, heard_m=28.0)
    field = field_of(line, places=places, hand_m=90.0, radius_m=30.0, reach_m=35.0, spline={"last_step": last_step})
    field.until(40)
    points = [(t_ns, p) for t_ns, id, p in field.points if id == BASE and p.tracker == "ml+spline"]
    assert len({t_ns for t_ns, _ in points}) == 1
    live = [t_ns for t_ns, id, p in field.points if id == BASE and p.tracker == "ml"]
    ended_ns = points[0][0]
    if last_step:
        assert ended_ns == ORIGIN_NS + last_step * STEP_NS + 450_000_000
        assert max(live) >= ended_ns
    else:
        assert ended_ns == max(live) + STEP_NS
    for _, point in points:
        x, y, *_ = line.at((point.at_ns - ORIGIN_NS) / NS)
        assert hypot(point.mean[0] - x, point.mean[1] - y) < 0.1
    assert {point.step for _, point in points} >= set(range(14, 33))


def test_a_run_has_such_tracks_beside_the_live_ones() -> None:
    """Three clusters along a road; a filter that does not solve for passes has none, and that is said."""
    plan = plan_of(THREE, fusion__smooth_rts=True, fusion__trackers=["ml", "ukf"])
    assert plan.info.trackers == ("ml", "ukf", "ml+spline")
    assert plan.whole("ml+spline")
    assert [one for one in remarks(plan) if "smoothed" in one] == [
        "ukf does not solve for passes, so its track is not smoothed"
    ]
    _, rows = simulated(plan)
    found = [row for row in rows if row.point.tracker == "ml+spline"]
    assert {row.point.source for row in found} == {"base"}
    assert len(found) >= 20
    for row in found:
        assert row.truth is not None
        assert hypot(row.point.mean[0] - row.truth[0], row.point.mean[1] - row.truth[1]) < 1.0
