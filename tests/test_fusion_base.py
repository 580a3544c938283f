"""The base: what it makes of what it is told, late or not, and of whole tracks at their end."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any
from unittest import mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion.base import Base, Memory
from tests.clustered import ASSOCIATION, bank_of
from tests.puppet import MS
from tests.test_filters_rts import DT, PRIOR, SIGMA_V, filtered, jointly, wandering
from trackfield.filters.belief import Belief
from trackfield.filters.types import Gaussian
from trackfield.role import (
    NS,
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    Late,
    Publish,
    Received,
    Send,
    SetTimer,
    Started,
    Store,
    Timer,
    TrackPoint,
)
from trackfield.tracking import intervals
from trackfield.tracking.stored import pack
from trackfield.wire.clusters import LedTrack
from trackfield.wire.listed import packed
from trackfield.wire.peers import Result

STEP_NS, DEADLINE_NS = round(DT * NS), 400 * MS
SLAVES = [(0.0, 0.0), (100.0, 0.0), (0.0, 100.0)]
NAME = "ukf+rts"
FLOAT32 = {"rel": 1e-5, "abs": 1e-4}
"""A told belief is rounded to 24 bits: here, of numbers below 100, by less than 1e-5."""


def base(*, rts: bool = True, last_step: int = 0, **bank: Any) -> Base:
    own = {**bank_of(SLAVES, None), "step_ns": STEP_NS, "origin_ns": 0, "sigma_v": SIGMA_V, **bank}
    return Base(deadline_ns=DEADLINE_NS, rts=rts, last_step=last_step, **own)


def told(
    step: int, belief: Belief | None, *, number: int = 1, sensors: Sequence[int] = (0, 2), at_ns: int | None = None
) -> Received:
    """What a leader says of a step; if nothing is said of the time, just before that is published."""
    at_ns = step * STEP_NS + DEADLINE_NS - MS if at_ns is None else at_ns
    return Received(at_ns, LedTrack(number, step, packed(sensors), pack(step, None, {"ukf": belief})), f"m{number}")


def played(role: Base, words: Iterable[Received], steps: int, memory: Memory | None = None) -> tuple[Memory, list[Any]]:
    """The effects of a life up to the deadline of a step, in which this is said."""
    effects = list[Effect]()
    if memory is None:
        memory, effects[:] = role.handle(role.begin(), Started(0))
    due = [Timer(step * STEP_NS + DEADLINE_NS, "step") for step in range(memory.done + 1, steps + 1)]
    events: list[Event] = sorted([*words, *due], key=lambda event: event.now)
    for event in events:
        memory, more = role.handle(memory, event)
        effects += more
    return memory, effects


def points(effects: Iterable[Any], name: str = NAME) -> list[TrackPoint]:
    return [one.estimate for one in effects if isinstance(one, Publish) and one.estimate.tracker == name]


def beliefs(seed: int = 0, n: int = 25, heard: Any = None) -> tuple[list[Gaussian], Any]:
    """A Kalman filter's beliefs about the steps from 1 on, and what it measured."""
    z = wandering(seed, n)
    return [Gaussian(*one) for one in zip(*filtered(PRIOR, z, heard), strict=True)], z


def same(found: Sequence[TrackPoint], mean: Any, covariance: Any) -> None:
    assert np.array([point.mean for point in found]) == pytest.approx(mean, **FLOAT32)
    assert np.reshape([point.covariance for point in found], (-1, 4, 4)) == pytest.approx(covariance, **FLOAT32)


# --- whole tracks -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
def test_in_the_linear_case_each_point_is_the_state_given_all_measurements_of_the_track(seed: int) -> None:
    """Steps that were not told, as nothing was measured, are predicted over, those at the end too."""
    n = 25
    heard = np.random.default_rng(seed).random(n) < 0.6
    heard[0], heard[-2:] = True, False
    known, z = beliefs(seed, n, heard)
    words = [told(k + 1, known[k]) for k in range(n) if heard[k]]
    _, effects = played(base(last_step=n), words, n)
    found = points(effects)
    assert [point.step for point in found] == list(range(1, n + 1))
    same(found, *jointly(PRIOR, z, heard))
    assert [point.lag for point in found] == list(range(n - 1, -1, -1))
    assert [point.status == "tracking" for point in found] == heard.tolist()
    assert {point.sensors for point, was in zip(found, heard, strict=True) if was} == {("s00", "s02")}
    assert {(point.term, point.origin, point.at_ns == point.step * STEP_NS) for point in found if point.step} == {
        (1, "m1", True)
    }


def test_live_points_and_all_else_are_none_the_different_and_nothing_is_sent() -> None:
    known, _ = beliefs()
    words = [told(k + 1, one) for k, one in enumerate(known)]
    _, with_rts = played(base(last_step=25), words, 25)
    _, without = played(base(rts=False), words, 25)
    assert [one for one in with_rts if not (isinstance(one, Publish) and one.estimate.tracker == NAME)] == without
    assert not any(isinstance(one, Send) for one in with_rts)
    assert points(without) == []


def test_what_comes_late_is_no_live_track_but_is_smoothed() -> None:
    """Steps 4 and 9 come two steps later: the smoothed track is that of a base that heard all in time."""
    known, z = beliefs()
    on_time = [told(k + 1, one) for k, one in enumerate(known)]
    late = [replace(one, now=one.now + 2 * STEP_NS) if one.message.step in (4, 9) else one for one in on_time]
    _, effects = played(base(last_step=25), late, 25)
    same(points(effects), *jointly(PRIOR, z))
    assert [point.known_step for point in points(effects, "ukf")][3:12] == [3, 5, 6, 7, 8, 8, 10, 11, 12]
    assert sum(isinstance(one, Late) for one in effects) == 2
    assert sum(isinstance(one, Store) for one in effects) == 23
    _, effects = played(base(rts=False), late, 25)
    assert sum(one == Ignored("outdated") for one in effects) == 2


def test_what_is_told_twice_counts_once() -> None:
    known, z = beliefs()
    words = [told(k + 1, one) for k, one in enumerate(known)]
    _, effects = played(base(last_step=25), [*words, told(7, known[20], at_ns=11 * STEP_NS)], 25)
    same(points(effects), *jointly(PRIOR, z))
    assert Ignored("outdated") in effects


def test_a_lower_term_ends_where_a_higher_begins_whichever_is_heard_first() -> None:
    """An old leader goes on for three steps, about a target elsewhere, as it did not hear that it was followed."""
    known, z = beliefs()
    right = [told(k + 1, one, number=1 if k < 10 else 2) for k, one in enumerate(known)]
    away = [Gaussian(one.mean + 3.0, one.covariance) for one in known]
    for late_ns in (-2 * MS, MS, 4 * STEP_NS):
        old = [told(k, away[k - 1], at_ns=k * STEP_NS + DEADLINE_NS - 5 * MS + late_ns) for k in (11, 12, 13)]
        _, effects = played(base(last_step=25), [*right, *old], 25)
        found = points(effects)
        same(found, *jointly(PRIOR, z))
        assert [(point.term, point.origin) for point in found] == [(1, "m1")] * 10 + [(2, "m2")] * 15


# --- where a track ends -----------------------------------------------------------------------------------------------


def test_a_track_ends_where_its_live_one_is_given_up_and_is_told_then() -> None:
    """Nothing is told from step 6 to 40: the sd of the position exceeds ``lost_m`` before that."""
    known, _ = beliefs(n=5)
    again = [Gaussian(one.mean, one.covariance) for one in known]
    words = [*(told(k + 1, one) for k, one in enumerate(known)), *(told(k + 41, one) for k, one in enumerate(again))]
    role = base(lost_m=20.0, last_step=45)
    memory, effects = played(role, words[:5], 40)
    live, found = points(effects, "ukf"), points(effects)
    assert live[-1].step is not None
    assert 10 < live[-1].step < 35
    assert [point.step for point in found] == [point.step for point in live]
    assert found[0].lag == live[-1].step  # with the first step without a live point
    assert found[-1].mean == pytest.approx(live[-1].mean, **FLOAT32)
    assert memory.kept.told == ()
    _, effects = played(role, words[5:], 45, memory)
    assert [point.step for point in points(effects)] == [41, 42, 43, 44, 45]


def test_a_leader_that_says_that_it_lost_the_target_ends_the_track() -> None:
    known, z = beliefs(n=8)
    words = [*(told(k + 1, one) for k, one in enumerate(known)), told(9, None)]
    _, effects = played(base(), words, 12)
    same(points(effects), *jointly(PRIOR, z))
    assert {point.lag + point.step for point in points(effects) if point.step} == {9}


@pytest.mark.parametrize(
    ("off", "wider"), [(60.0, 1.0), (0.0, 25.0)], ids=["far from the predicted position", "much less sure"]
)
def test_a_track_that_began_anew_is_not_smoothed_into_the_one_before(off: float, wider: float) -> None:
    before, z = beliefs(n=8)
    after = Gaussian(before[-1].mean + np.array([off, 0.0, 0.0, 0.0]), before[-1].covariance * wider)
    words = [*(told(k + 1, one) for k, one in enumerate(before)), told(9, after)]
    _, effects = played(base(last_step=9), words, 9)
    found = points(effects)
    same(found[:8], *jointly(PRIOR, z))
    assert found[8].mean == pytest.approx(after.mean, **FLOAT32)


def test_without_the_last_step_of_the_run_a_track_that_goes_on_is_not_told() -> None:
    known, _ = beliefs()
    memory, effects = played(base(), [told(k + 1, one) for k, one in enumerate(known)], 25)
    assert points(effects) == []
    assert len(memory.kept.told) == 25


def test_a_long_track_is_told_in_parts_each_step_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of more than 12 steps the older half is told; 6 later steps say almost all that there is to say."""
    monkeypatch.setattr(intervals, "MOST", 12)
    n = 60
    known, z = beliefs(n=n)
    role, found, memory = base(last_step=n), list[TrackPoint](), None
    for k, one in enumerate(known):
        memory, effects = played(role, [told(k + 1, one)], k + 1, memory)
        found += points(effects)
        assert len(memory.kept.told) <= 12
    assert [point.step for point in found] == list(range(1, n + 1))
    assert max(point.lag for point in found) == 12
    mean, covariance = jointly(PRIOR, z)
    errors = np.array([point.mean for point in found]) - mean
    assert np.sqrt((errors[:, :2] ** 2).sum(axis=1).mean()) < 0.1 * np.sqrt(covariance[:, 0, 0].mean())


def test_what_comes_after_its_part_was_told_is_of_no_use(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(intervals, "MOST", 12)
    known, _ = beliefs()
    words = [told(k + 1, one) for k, one in enumerate(known) if k != 2]
    _, effects = played(base(last_step=25), [*words, told(3, known[2], at_ns=20 * STEP_NS)], 25)
    assert [point.step for point in points(effects)] == list(range(1, 26))
    assert Ignored("outdated") in effects


def test_a_next_life_smooths_what_the_one_before_was_told_last_and_what_it_is_told_itself() -> None:
    known, _ = beliefs()
    words, role = [told(k + 1, one) for k, one in enumerate(known)], base(last_step=25)
    _, effects = played(role, words[:10], 10)
    kept = next(one.data for one in reversed(effects) if isinstance(one, Store))
    memory, _ = role.handle(role.begin(), Started(12 * STEP_NS, kept))
    _, effects = played(role, words[12:], 25, memory)
    assert [point.step for point in points(effects)] == list(range(10, 26))


def test_a_step_handled_twice_gives_the_same() -> None:
    """States are values: going back to one, as drivers do, finds it as it was."""
    known, _ = beliefs()
    role = base(last_step=25)
    memory, _ = played(role, [told(k + 1, one) for k, one in enumerate(known)], 24)
    last = Timer(25 * STEP_NS + DEADLINE_NS, "step")
    assert role.handle(memory, last)[1] == role.handle(memory, last)[1]


def test_a_result_is_smoothed_as_one_that_tracks_though_it_names_no_sensor() -> None:
    """It has an sd of the position and one of the velocity, each the same both ways."""
    words = [
        Received(k * STEP_NS + DEADLINE_NS - MS, Result(1, k, 10.0 * k, 20.0, 10.0 / DT, 0.0, 2.0, 1.0), "m1")
        for k in (1, 2, 4)
    ]
    _, effects = played(base(last_step=4), words, 4)
    found = points(effects)
    assert [(point.status, point.sensors) for point in found] == [
        (status, ()) for status in ("tracking", "tracking", "coasting", "tracking")
    ]
    assert [point.mean for point in found] == [pytest.approx([10.0 * k, 20.0, 10.0 / DT, 0.0]) for k in (1, 2, 3, 4)]


@given(
    st.lists(
        st.tuples(
            *(st.integers(0, most) for most in (30, 3, 30, 4)),
            st.floats(-1e30, 1e30),
            st.floats(0.0, 1e30),
        ),
        max_size=30,
    )
)
@settings(deadline=None)
def test_whatever_it_is_told_no_step_is_told_twice_and_none_before_its_time(
    said: list[tuple[int, int, int, int, float, float]],
) -> None:
    """Of any term and step, at any time, with any belief or none."""
    words = [
        told(
            step, Gaussian(np.full(4, mean), np.eye(4) * variance) if kind else None, number=number, at_ns=at * STEP_NS
        )
        for at, number, step, kind, mean, variance in said
    ]
    with mock.patch.object(intervals, "MOST", 6):
        memory, effects = played(base(last_step=30), words, 30)
    steps = [point.step for point in points(effects)]
    assert steps == sorted(set(steps), key=lambda step: step or 0)
    assert all(point.lag >= 0 for point in points(effects))
    assert memory.kept.told == ()


# --- announcements ----------------------------------------------------------------------------------------------------


def test_it_announces_itself_only_if_it_is_told_to() -> None:
    quiet = base()
    memory, effects = quiet.handle(quiet.begin(), Started(0))
    assert [one.name for one in effects if isinstance(one, SetTimer)] == ["step"]
    with pytest.raises(IllegalEvent):
        quiet.handle(memory, Timer(NS, "announce"))
    announcing = {"id": "base", "x_m": 3.0, "y_m": 4.0, "association": {**ASSOCIATION, "capacity": 0, "share": 0.0}}
    own: dict[str, Any] = {**bank_of(SLAVES, None), **announcing}
    loud = Base(deadline_ns=DEADLINE_NS, **own)
    memory, effects = loud.handle(loud.begin(), Started(0))
    assert [one.name for one in effects if isinstance(one, SetTimer)] == ["announce", "step"]
    sent = next(one for one in loud.handle(memory, Timer(0, "announce"))[1] if isinstance(one, Send))
    assert (sent.message.x_m, sent.message.y_m) == (3.0, 4.0)
