"""Late reports: as if they had been on time if they are young enough, and of no use otherwise."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from random import Random
from typing import Any

import pytest

from fusion.memory import Memory
from fusion.role import Fusion
from tests.late_reports import rmse_of_s1
from tests.test_fusion_role import DEADLINE, PRIOR, SENSORS, centre, deadline, play, points, report, started
from trackfield.role import NS, Effect, Event, Ignored, Late, Received, TrackPoint

AGE = 3 * NS + 500_000_000
IDS = [id for id, _, _ in SENSORS]


def place(step: int) -> tuple[float, float]:
    return 30.0 + 5.0 * step, 40.0 + 3.0 * step


def told(step: int, sensor: str, delay_ns: int = 1_000_000) -> Received:
    x, y = place(step)
    return report(step, sensor, x=x + 2.0 * Random(f"{step}{sensor}").gauss(), y=y, delay_ns=delay_ns)


def run(fusion: Fusion, events: Iterable[Event]) -> tuple[Memory, list[Effect]]:
    """In the order in which a driver hands them over: what is due at the same time, frames first."""
    return play(fusion, started(fusion), sorted(events, key=lambda e: (e.now, not isinstance(e, Received))))


def last_words(effects: Sequence[Effect]) -> dict[tuple[str, int], TrackPoint]:
    """What was published last of each step, as the recorder keeps it."""
    return {(point.tracker, point.step): point for point in points(effects)}


@pytest.mark.parametrize("prior", [None, PRIOR])
@pytest.mark.parametrize("which", ["some", "all"])
def test_late_reports_within_the_age_give_the_track_of_those_on_time_bit_for_bit(which: str, prior: Any) -> None:
    """One to three steps late: every step's last word is what it would have been."""
    draw, steps = Random(which), range(1, 13)
    fusion = centre("imm-ukf", "spcpf", "bootstrap", prior=prior, max_age_ns=AGE)
    on_time = [told(step, id) for step in steps for id in IDS]
    late = [
        told(step, id, 1_000_000 + draw.randint(1, 3) * NS) if which == "all" or draw.random() < 0.4 else told(step, id)
        for step in steps
        for id in IDS
    ]
    deadlines = [deadline(step) for step in range(1, 17)]
    _, before = run(fusion, [*on_time, *deadlines])
    memory, after = run(fusion, [*late, *deadlines])
    assert last_words(after) == last_words(before)
    assert len([e for e in after if isinstance(e, Late)]) == sum(e.now > e.message.step * NS + DEADLINE for e in late)
    assert not [e for e in after if isinstance(e, Ignored)]
    assert memory.progress.collected.stale is None


def test_without_an_age_a_late_report_is_ignored_and_nothing_is_kept() -> None:
    fusion = centre()
    memory, effects = run(fusion, [told(1, "n0"), deadline(1), told(1, "n1", NS), deadline(2)])
    assert [e for e in effects if isinstance(e, Ignored | Late)] == [Ignored("late")]
    assert [p.sensors for p in points(effects)] == [("n0",), ()]
    assert not memory.progress.before
    assert not memory.progress.collected.recent


def test_every_step_since_is_published_anew_before_the_new_one() -> None:
    fusion = centre(max_age_ns=AGE)
    memory, _ = run(fusion, [*(told(step, id) for step in (1, 2, 3) for id in IDS[:3]), *map(deadline, (1, 2, 3))])
    memory, effects = play(fusion, memory, [told(2, "n3", NS + 400_000_000), deadline(4)])
    assert effects[0] == Late()
    assert [(p.step, p.sensors) for p in points(effects)] == [(2, (*IDS[:4],)), (3, (*IDS[:3],)), (4, ())]
    _, effects = fusion.handle(memory, deadline(5))
    assert [p.step for p in points(effects)] == [5]  # and only once


@pytest.mark.parametrize(
    ("late", "effect"),
    [
        (told(2, "n3", AGE), Late()),
        (told(2, "n3", AGE + 1), Ignored("late")),
        (told(2, "n0", AGE), Ignored("repeated")),
        (told(2, "stranger", AGE), Ignored("unknown sensor")),
        (Received(5 * NS + 500_000_000, told(0, "n3").message, "n3"), Ignored("late")),
    ],
)
def test_which_late_reports_count(late: Received, effect: Effect) -> None:
    fusion = centre(max_age_ns=AGE)
    memory, _ = run(fusion, [told(2, "n0"), *map(deadline, range(1, 6))])
    after, effects = fusion.handle(memory, late)
    assert effects == (effect,)
    assert (after is memory) == isinstance(effect, Ignored)


def test_a_late_report_counts_once() -> None:
    fusion = centre(max_age_ns=AGE)
    memory, _ = run(fusion, [told(1, "n0"), deadline(1)])
    _, effects = play(
        fusion, memory, [told(1, "n1", NS), told(1, "n1", NS + 1), deadline(2), told(1, "n1", NS + DEADLINE)]
    )
    assert [e for e in effects if isinstance(e, Ignored | Late)] == [Late(), Ignored("repeated"), Ignored("repeated")]
    assert points(effects)[0].reports == 2


def test_what_is_kept_is_bounded_by_the_age() -> None:
    """A step is forgotten once no report of it could count: 3.5 s old at most, and deadlines 0.3 s after."""
    fusion = centre(max_age_ns=AGE)
    memory = started(fusion)
    for step in range(1, 50):
        memory, _ = play(fusion, memory, [told(step, "n0"), deadline(step)])
        assert sorted(memory.progress.before) == list(range(max(step - 3, 1), step + 1))
        assert set(memory.progress.before) == set(memory.progress.collected.recent)


def test_a_fifth_of_the_reports_late_costs_next_to_nothing() -> None:
    on_time, late, dropped = rmse_of_s1(range(10))
    print(f"position rmse: on time {on_time:.3f} m, replayed {late:.3f} m, without replay {dropped:.3f} m")
    assert late <= 1.05 * on_time
    assert dropped > late
