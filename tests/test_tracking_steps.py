"""Trackers from step to step, without any role: late reports, a restart, another process's timers."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest

from tests.sensing import arrays
from tests.test_fusion_role import DEADLINE, PRIOR, SENSORS, report
from trackfield.role import NS, Effect, Ignored, Late, SetTimer, TrackPoint
from trackfield.tracking.bank import Bank
from trackfield.tracking.steps import Progress, Steps, Taken

IDS = [id for id, _, _ in SENSORS]
AGE = 3 * NS
TARGET = (60.0, 50.0)


def head(*trackers: str, max_age_ns: int = 0, prior: Any = None) -> Steps:
    """What a cluster head would compose."""
    bank = Bank(
        trackers=trackers or ("imm-ukf",),
        sensors=SENSORS,
        step_ns=NS,
        seed=1,
        sensing=arrays(),
        prior=prior,
        target="bus",
        draws=("head",),
    )
    return Steps(bank, deadline_ns=DEADLINE, max_age_ns=max_age_ns, timer="fuse")


def due(step: int) -> int:
    return step * NS + DEADLINE


def tell(steps: Steps, state: Progress, step: int, sensor: str, now: int) -> tuple[Progress, tuple[Effect, ...]]:
    message = report(step, sensor, x=TARGET[0], y=TARGET[1]).message
    return steps.collect(state, now, step, message, sensor)


def taken(steps: Steps, state: Progress, sensors: Iterable[str] = IDS) -> Taken:
    """The next step, in which these sensors report in time."""
    step = state.step + 1
    for sensor in sensors:
        state, effects = tell(steps, state, step, sensor, step * NS + 1)
        assert effects == ()
    return steps.take(state, due(step))


def lived(steps: Steps, count: int) -> tuple[Progress, bytes]:
    """After so many steps: the state, and what would be stored."""
    state = steps.start(steps.begin(), 0, b"").state
    for _ in range(count):
        state = taken(steps, state).state
    return state, steps.keep(state)


def test_each_step_has_a_point_of_each_tracker_and_a_timer_of_the_given_name() -> None:
    steps = head("imm-ukf", "spcpf")
    state = steps.start(steps.begin(), 0, b"").state
    assert steps.deadline(state) == SetTimer("fuse", due(1))
    first = taken(steps, state)
    assert list(first.points) == ["imm-ukf", "spcpf"]
    assert first.all == tuple(first.points.values())
    assert [(p.step, p.sensors, p.target) for p in first.all] == [(1, tuple(IDS), "bus")] * 2
    assert steps.deadline(first.state) == SetTimer("fuse", due(2))


def test_a_late_report_takes_every_step_since_again_and_ends_where_it_would_have_been_in_time() -> None:
    steps = head("imm-ukf", "spcpf", "bootstrap", max_age_ns=AGE, prior=PRIOR)
    state = steps.start(steps.begin(), 0, b"").state
    patient = state
    for heard in (IDS, IDS[:3], IDS):
        state = taken(steps, state, heard).state
        on_time = taken(steps, patient)
        patient = on_time.state
    state, effects = tell(steps, state, 2, "n3", due(3) + 1)
    assert effects == (Late(),)
    late, on_time = taken(steps, state), taken(steps, patient)
    assert [(p.step, p.tracker) for p in late.all] == [(s, t) for s in (2, 3, 4) for t in steps.bank.trackers]
    assert late.points == on_time.points
    assert on_time.all == tuple(on_time.points.values())
    assert taken(steps, late.state).all == taken(steps, on_time.state).all


def test_without_an_age_nothing_is_kept_and_nothing_taken_again() -> None:
    steps = head()
    state = taken(steps, steps.start(steps.begin(), 0, b"").state, IDS[:3]).state
    assert not state.before
    assert tell(steps, state, 1, "n3", due(1) + 1) == (state, (Ignored("late"),))
    assert [p.step for p in taken(steps, state).all] == [2]


def test_a_smoothed_track_follows_the_points_of_the_step() -> None:
    bank = Bank(trackers=("ekf",), sensors=SENSORS, step_ns=NS, seed=1, sensing=arrays(), smooth_lag=2)
    steps = Steps(bank, deadline_ns=DEADLINE)
    state = lived(steps, 3)[0]
    after = taken(steps, state)
    assert [(p.tracker, p.step) for p in after.all] == [("ekf", 4), ("ekf+lag2", 2)]
    assert list(after.points) == ["ekf"]


# --- restarts ---


def test_a_next_life_predicts_over_the_steps_that_it_missed() -> None:
    steps = head("imm-ukf", "ekf")
    _, kept = lived(steps, 8)
    begun = steps.start(steps.begin(), 12 * NS, kept)
    assert (begun.state.step, begun.unusable) == (11, ())
    assert [(p.tracker, p.step, p.status) for p in begun.points] == [
        ("imm-ukf", 11, "coasting"),
        ("ekf", 11, "coasting"),
    ]
    assert begun.stored is not None
    assert begun.stored.step == 8
    after = taken(steps, begun.state)
    assert after.points["imm-ukf"].mean[:2] == pytest.approx(TARGET, abs=1.0)


@pytest.mark.parametrize("kept", [b"\xc1", b"garbage", b"\x94\x01\x02"])
def test_garbage_is_a_reason_and_a_fresh_start(kept: bytes) -> None:
    steps = head(prior=PRIOR)
    for now, step, status in ((0, 0, "coasting"), (9 * NS, 8, "waiting")):
        begun = steps.start(steps.begin(), now, kept)
        assert len(begun.unusable) == 1
        assert (begun.stored, begun.points, begun.state.step) == (None, (), step)
        assert point_of(taken(steps, begun.state, ())).status == status


def test_a_step_that_is_yet_to_come_is_a_reason_and_a_fresh_start() -> None:
    steps = head()
    _, kept = lived(steps, 8)
    begun = steps.start(steps.begin(), 5 * NS, kept)
    assert begun.unusable == ("step 8 is in the future",)
    assert begun.state.step == 4


def point_of(step: Taken) -> TrackPoint:
    (point,) = step.points.values()
    return point
