"""When a node has its receiver on for the centre's commands."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from node.duty import Duty
from tests.puppet import MS
from trackfield.role import NS

DUTY = Duty(NS, listen_from_ns=300 * MS, listen_for_ns=400 * MS)


@pytest.mark.parametrize(
    ("time_ms", "on", "again_ms"),
    [
        (5000, False, 5300),  # as it reads its sensor
        (5299, False, 5300),
        (5300, True, 5700),
        (5450, True, 5700),
        (5699, True, 5700),
        (5700, False, 6300),
        (6299, False, 6300),
    ],
)
def test_it_listens_from_the_deadline_on_for_a_while(time_ms: int, on: bool, again_ms: int) -> None:
    assert DUTY.at(time_ms * MS, known=5) == (on, (again_ms - time_ms) * MS)


def test_it_listens_until_it_knows_of_the_coming_step() -> None:
    listening, knowing = (True, 350 * MS), (False, 950 * MS)
    assert [DUTY.at(5350 * MS, known) for known in (-1, 4, 5, 6, 7)] == [listening] * 3 + [knowing] * 2


def test_a_window_may_begin_before_the_steps_instant_and_end_after_the_next() -> None:
    """The deadline is soon, or the clock may be far off; or the deadline is late."""
    early, late = Duty(NS, -50 * MS, 200 * MS), Duty(NS, 900 * MS, 300 * MS)
    assert [early.at(t * MS, 4)[0] for t in (4949, 4950, 5000, 5149, 5150)] == [False, True, True, True, False]
    assert [late.at(t * MS, 4)[0] for t in (4899, 4900, 5000, 5199, 5200)] == [False, True, True, True, False]


def test_one_whose_window_is_a_whole_step_listens_until_it_was_told() -> None:
    always = Duty(NS, 300 * MS, NS)
    assert [always.at(t * MS, 4) for t in (4300, 4800, 5299)] == [(True, NS), (True, 500 * MS), (True, MS)]
    assert always.at(5200 * MS, 5) == (False, 100 * MS)


@given(
    st.builds(Duty, st.just(100), st.integers(-250, 100), st.integers(0, 100)),
    st.integers(-500, 10_000),
    st.integers(-1, 100),
)
def test_nothing_changes_before_it_has_to_be_asked_again(duty: Duty, time_ns: int, known: int) -> None:
    on, wait_ns = duty.at(time_ns, known)
    assert 0 < wait_ns <= 100
    assert {duty.at(t, known)[0] for t in range(time_ns, time_ns + wait_ns)} == {on}
