"""Reports by step, without any role: which are kept, until when, and why others are not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import pytest

from trackfield.role import NS, Effect, Ignored, Late
from trackfield.tracking.collecting import Collected, Collecting

CLOSES = 300_000_000
"""After its instant each step is closed here."""


class EverySecond(NamedTuple):
    """Step 0 is at 10 s."""

    def at_ns(self, step: int) -> int:
        return (10 + step) * NS

    def step_at(self, t_ns: int) -> int:
        return t_ns // NS - 10


AT = EverySecond()
STRICT = Collecting(AT, {"a", "b", "c"})
PATIENT = Collecting(AT, {"a", "b", "c"}, max_age_ns=2 * NS)


def take(piece: Collecting, state: Collected, step: int, sender: str, after_ns: int = 1) -> tuple[Collected, Any]:
    """A report on a step, which comes ``after_ns`` after its instant and says who sent it."""
    return piece.take(state, AT.at_ns(step) + after_ns, step, f"{sender}{step}", sender)


def closed(piece: Collecting, state: Collected, steps: int) -> tuple[Collected, list[dict[str, str]]]:
    """So many steps closed; also what each of them had."""
    had = []
    for _ in range(steps):
        state, heard = piece.close(state, AT.at_ns(state.closed + 1) + CLOSES)
        had.append(dict(heard))
    return state, had


def told(piece: Collecting, state: Collected, *reports: tuple[int, str]) -> Collected:
    for step, sender in reports:
        state, effects = take(piece, state, step, sender)
        assert effects == ()
    return state


def test_a_step_has_the_reports_on_it_whenever_they_came_before_it_was_closed() -> None:
    state = told(STRICT, Collected(), (1, "b"), (2, "b"), (1, "a"))
    state, (first, second, third) = closed(STRICT, state, 3)
    assert (first, second, third) == ({"a": "a1", "b": "b1"}, {"b": "b2"}, {})
    assert (state.closed, len(state.ahead), len(state.recent)) == (3, 0, 0)


@pytest.mark.parametrize(
    ("step", "sender", "after_ns", "reason"),
    [
        (1, "b", NS, "late"),
        (0, "b", NS, "late"),
        (1, "stranger", NS, "late"),
        (2, "stranger", 1, "unknown sensor"),
        (4, "stranger", -NS - 1, "unknown sensor"),
        (4, "b", -NS - 1, "from the future"),
        (60_000, "b", -59_000 * NS, "from the future"),
        (2, "a", 1, "repeated"),
    ],
)
def test_a_report_of_no_use_leaves_everything_as_it_was(step: int, sender: str, after_ns: int, reason: str) -> None:
    """Step 1 is closed, and "a" has reported on step 2."""
    state = told(STRICT, closed(STRICT, Collected(), 1)[0], (2, "a"))
    after, effects = take(STRICT, state, step, sender, after_ns)
    assert after is state
    assert effects == (Ignored(reason),)


def test_the_coming_step_counts_as_soon_as_the_one_before_has_begun() -> None:
    after, effects = take(STRICT, Collected(), 4, "b", -NS)
    assert effects == ()
    assert dict(after.ahead[4]) == {"b": "b4"}


def test_late_reports_are_kept_up_to_their_age_and_once() -> None:
    state, _ = closed(PATIENT, told(PATIENT, Collected(), (2, "a")), 3)
    expected: Sequence[tuple[int, str, int, Effect]] = [
        (3, "b", NS, Late()),
        (2, "b", 2 * NS, Late()),
        (2, "b", 2 * NS, Ignored("repeated")),
        (2, "a", 2 * NS, Ignored("repeated")),
        (2, "c", 2 * NS + 1, Ignored("late")),
        (1, "c", 2 * NS + CLOSES, Ignored("late")),
        (2, "stranger", 2 * NS, Ignored("unknown sensor")),
    ]
    for step, sender, after_ns, effect in expected:
        state, effects = take(PATIENT, state, step, sender, after_ns)
        assert effects == (effect,)
    assert state.stale == 2
    assert {step: dict(heard) for step, heard in state.recent.items()} == {2: {"a": "a2", "b": "b2"}, 3: {"b": "b3"}}


def test_once_the_next_step_is_closed_late_reports_are_not_new_any_more() -> None:
    state, _ = closed(PATIENT, Collected(), 3)
    state, _ = take(PATIENT, state, 3, "a", NS)
    assert state.stale == 3
    state, _ = closed(PATIENT, state, 1)
    assert state.stale is None
    assert dict(state.recent[3]) == {"a": "a3"}


def test_what_is_kept_is_bounded_by_the_age() -> None:
    state = Collected()
    for step in range(1, 50):
        state, _ = closed(PATIENT, told(PATIENT, state, (step, "a")), 1)
        assert sorted(state.recent) == list(range(max(step - 1, 1), step + 1))


def test_after_a_restart_the_steps_before_it_are_late_whatever_the_age() -> None:
    state = Collected(closed=8)
    assert take(PATIENT, state, 8, "a", CLOSES) == (state, (Ignored("late"),))
    assert take(PATIENT, state, 9, "a")[1] == ()
