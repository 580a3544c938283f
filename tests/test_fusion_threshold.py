"""The threshold that the centre commands: how it steps, and who is told."""

from __future__ import annotations

from typing import Any

import pytest

from fusion.memory import Memory
from fusion.role import Fusion
from tests.sensing import arrays
from tests.test_fusion_restart import lived
from tests.test_fusion_role import centre, deadline, play, points, report, started
from trackfield.role import NS, Effect, Send, Started, TrackPoint
from trackfield.tracking.threshold import Controller, expected_place, position_sd
from trackfield.wire.messages import Threshold

BOUNDS = {"low_db": 49.0, "high_db": 56.0, "start_db": 52.5, "target_sd_m": 3.0, "reach_m": 60.0}
WIDE = {**BOUNDS, "reach_m": 80.0}
CONTROLLER = Controller(**BOUNDS)


@pytest.mark.parametrize(
    ("level", "sd", "after"),
    [
        (52.5, 3.01, 52.0),
        (52.5, 3.0, 52.5),
        (52.5, 2.41, 52.5),
        (52.5, 2.39, 53.0),
        (49.2, 50.0, 49.0),
        (49.0, 50.0, 49.0),
        (55.8, 0.5, 56.0),
        (56.0, 0.5, 56.0),
    ],
)
def test_it_steps_towards_the_target_within_its_bounds(level: float, sd: float, after: float) -> None:
    assert CONTROLLER.adjusted(level, sd) == after


def test_it_settles_where_the_uncertainty_is_right() -> None:
    """A field in which each dB less halves the sd's distance to 1 m: it comes to the band and stays."""
    level, levels = CONTROLLER.high_db, []
    for _ in range(40):
        level = CONTROLLER.adjusted(level, 0.4 * (level - 46.0))
        levels.append(level)
    assert set(levels[-20:]) == {levels[-1]}
    assert 2.4 <= 0.4 * (levels[-1] - 46.0) <= 3.0


def point(xx: float, xy: float, yy: float) -> TrackPoint:
    covariance = (xx, xy, 0.0, 0.0, xy, yy, 0.0, 0.0, *[0.0] * 8)
    return TrackPoint("a", "bus", NS, "tracking", (10.0, 20.0, 3.0, -4.0), covariance, step=1)


@pytest.mark.parametrize(
    ("covariance", "sd"),
    [((9.0, 0.0, 4.0), 3.0), ((4.0, 0.0, 25.0), 5.0), ((5.0, 4.0, 5.0), 3.0), ((0.0, 0.0, 0.0), 0.0)],
)
def test_the_sd_is_that_of_the_widest_axis(covariance: tuple[float, float, float], sd: float) -> None:
    assert position_sd(point(*covariance)) == pytest.approx(sd)


def test_where_the_target_will_be() -> None:
    assert expected_place(point(1.0, 0.0, 1.0), 0.5) == (11.5, 18.0)


# --- in the centre ---


def sent(effects: list[Effect]) -> list[Send]:
    return [effect for effect in effects if isinstance(effect, Send)]


def at(step: int, x: float, y: float, *ids: str) -> list[Any]:
    return [*(report(step, id, x=x, y=y) for id in ids or ("n0", "n1", "n2", "n3")), deadline(step)]


def fused(fusion: Fusion, *steps: Any) -> tuple[Memory, list[Effect]]:
    return play(fusion, started(fusion), [event for step in steps for event in step])


def test_who_is_about_to_hear_the_target_is_told_for_the_coming_step() -> None:
    """From (20, 20), n0 is 28 m away and the next, n1 and n2, 82 m; four far bearings fix it to some 2.6 m."""
    fusion = centre(threshold=BOUNDS)
    _, effects = fused(fusion, at(1, 20.0, 20.0))
    (send,) = sent(effects)
    sd = position_sd(points(effects)[0])
    assert send.to == frozenset({"n0"})
    assert send.message == Threshold(2, CONTROLLER.adjusted(52.5, sd))


def test_they_are_told_in_every_step_whether_it_changed_or_not() -> None:
    fusion = centre(threshold={**WIDE, "low_db": 52.5, "high_db": 52.5})
    _, effects = fused(fusion, *(at(step, 50.0, 45.0) for step in range(1, 6)))
    assert [send.message for send in sent(effects)] == [Threshold(step, 52.5) for step in range(2, 7)]


def test_a_moving_target_is_announced_to_those_ahead() -> None:
    fusion = centre(threshold={**BOUNDS, "reach_m": 40.0})
    _, effects = fused(fusion, *(at(step, 10.0 + 12.0 * step, 10.0) for step in range(1, 7)))
    told = [send.to for send in sent(effects)]
    assert told[0] == frozenset({"n0"})
    assert told[-1] == frozenset({"n1"})  # at 82 m and on its way to 94 m


def test_an_unsure_track_lowers_it_step_by_step_and_a_sure_one_raises_it() -> None:
    unsure = centre(threshold=WIDE, sensing=arrays(15.0))
    _, effects = fused(unsure, *(at(step, 50.0, 45.0, "n0", "n1") for step in range(1, 6)))
    levels = [send.message.level_db for send in sent(effects)]
    assert levels == [52.0, 51.5, 51.0, 50.5, 50.0][: len(levels)]
    assert len(levels) >= 3
    sure = centre(threshold=WIDE, sensing=arrays(0.5))
    _, effects = fused(sure, *(at(step, 50.0, 45.0) for step in range(1, 10)))
    assert sent(effects)[-1].message.level_db == 56.0


def test_nobody_is_told_without_a_track_or_where_nobody_is_near() -> None:
    waiting = centre(threshold=BOUNDS)
    assert sent(fused(waiting, [deadline(1)])[1]) == []
    far = centre(threshold={**BOUNDS, "reach_m": 5.0})
    assert sent(fused(far, at(1, 50.0, 45.0))[1]) == []
    assert sent(fused(centre(), at(1, 50.0, 45.0))[1]) == []  # nor by a centre that commands no threshold


def test_after_the_last_step_that_a_message_can_count_nobody_is_told() -> None:
    fusion = centre(threshold=WIDE)
    memory, _ = fusion.handle(fusion.begin(), Started(65534 * NS))
    memory, effects = play(fusion, memory, at(65534, 50.0, 45.0))
    assert sent(effects)[0].message.step == 65535
    _, effects = play(fusion, memory, at(65535, 50.0, 45.0))
    assert points(effects)[0].status == "tracking"
    assert sent(effects) == []


def test_a_new_life_takes_over_the_threshold() -> None:
    fusion = centre(threshold={**BOUNDS, "target_sd_m": 50.0})
    kept = lived(fusion, 3)
    memory, _ = fusion.handle(fusion.begin(), Started(3 * NS + 900_000_000, kept))
    assert memory.threshold_db == 54.0
    narrower = centre(threshold={**BOUNDS, "high_db": 53.0})
    assert narrower.handle(narrower.begin(), Started(4 * NS, kept))[0].threshold_db == 53.0
    assert centre().handle(centre().begin(), Started(4 * NS, kept))[0].threshold_db is None
