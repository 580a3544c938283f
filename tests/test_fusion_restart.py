"""A centre that dies and comes back goes on from what it published last, or starts anew in the middle of a run."""

from __future__ import annotations

import struct

import msgpack
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion.memory import Phase
from fusion.role import Fusion
from tests.test_fusion_role import DEADLINE, PRIOR, SENSORS, centre, deadline, play, points, report, started
from trackfield.filters.types import Gaussian
from trackfield.role import NS, Note, Publish, SetTimer, Started, State, Store, TrackPoint
from trackfield.tracking.stored import pack, unpack

COVARIANCE = tuple((np.eye(4) + 0.25).ravel())
POINT = TrackPoint("a", "bus", 7 * NS, "tracking", (1.0, 2.0, 3.0, 4.0), COVARIANCE, ("n0", "n1", "n2"), step=7)


def place(step: int) -> tuple[float, float]:
    return 20.0 + 4.0 * step, 30.0 + 3.0 * step


def lived(fusion: Fusion, steps: int) -> bytes:
    """What the last of a life's steps stored, with the target seen by all in each."""
    memory, kept = started(fusion), b""
    for step in range(1, steps + 1):
        x, y = place(step)
        heard = [report(step, id, x=x, y=y) for id, _, _ in SENSORS]
        memory, effects = play(fusion, memory, [*heard, deadline(step)])
        (kept,) = (effect.data for effect in effects if isinstance(effect, Store))
    return kept


# --- the bytes ---


def test_what_is_packed_is_unpacked() -> None:
    stored = unpack(pack(7, 52.5, {"a": POINT, "b": TrackPoint("b", "bus", 7 * NS, "waiting", step=7)}))
    assert (stored.step, stored.threshold_db, set(stored.beliefs)) == (7, 52.5, {"a", "b"})
    belief = stored.beliefs["a"]
    assert belief is not None
    assert belief.mean.tolist() == list(POINT.mean)
    assert belief.covariance.ravel().tolist() == list(POINT.covariance)
    assert stored.beliefs["b"] is None


def test_a_tracker_takes_some_hundred_bytes() -> None:
    assert len(pack(65535, 52.5, {"fix-imm-ukf": POINT})) < 150


GOOD = struct.pack("<14d", 1, 2, 3, 4, 1, 0, 0, 0, 1, 0, 0, 1, 0, 1)


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"\xc1", "not MessagePack"),
        (b"", "not MessagePack"),
        (msgpack.packb(5), "not an array"),
        (msgpack.packb((1, 2)), "not an array"),
        (msgpack.packb((2, 3, None, {})), "version 2"),
        (msgpack.packb((1, -3, None, {})), "step -3"),
        (msgpack.packb((1, 3.5, None, {})), "step 3.5"),
        (msgpack.packb((1, 3, "x", {})), "threshold x"),
        (msgpack.packb((1, 3, float("nan"), {})), "threshold nan"),
        (msgpack.packb((1, 3, None, [])), "no beliefs"),
        (msgpack.packb((1, 3, None, {"a": GOOD[:-1]})), "not 14 numbers"),
        (msgpack.packb((1, 3, None, {"a": struct.pack("<14d", *[float("inf")] * 14)})), "not finite"),
        (msgpack.packb((1, 3, None, {"a": struct.pack("<14d", *[-1.0] * 14)})), "negative variance"),
    ],
)
def test_foreign_and_damaged_bytes_are_noted_and_no_more(data: bytes, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        unpack(data)
    fusion = centre()
    if data:
        memory, effects = fusion.handle(fusion.begin(), Started(9 * NS, data))
        assert isinstance(effects[0], Note)
        assert reason in effects[0].text
        assert effects[1:] == (SetTimer("deadline", 9 * NS + DEADLINE), State("waiting"))
        assert memory.phase is Phase.WAITING


@settings(max_examples=200)
@given(st.binary(max_size=200), st.integers(0, 160), st.binary(max_size=3))
def test_no_bytes_crash_it(garbage: bytes, at: int, patch: bytes) -> None:
    fusion, good = centre(), pack(7, None, {"fix-imm-ukf": POINT})
    for data in (garbage, good[:at], good[:at] + patch + good[at + len(patch) :]):
        memory, _ = fusion.handle(fusion.begin(), Started(9 * NS, data))
        fusion.handle(memory, deadline(memory.progress.step + 1))


# --- the next life ---


@pytest.mark.parametrize(
    ("now", "first"),
    [
        (0, 1),
        (NS + DEADLINE - 1, 1),
        (NS + DEADLINE, 2),
        (20 * NS, 20),
        (20 * NS + DEADLINE + 1, 21),
        (-5 * NS, 1),
    ],
)
def test_a_life_begins_with_the_step_whose_deadline_is_next(now: int, first: int) -> None:
    fusion = centre()
    memory, effects = fusion.handle(fusion.begin(), Started(now))
    assert effects == (SetTimer("deadline", first * NS + DEADLINE), State("waiting"))
    _, effects = fusion.handle(memory, deadline(first))
    assert [(p.step, p.status) for p in points(effects)] == [(first, "waiting")]


def test_a_prior_is_about_the_start_of_the_run_only() -> None:
    fusion = centre(prior=PRIOR)
    memory, _ = fusion.handle(fusion.begin(), Started(20 * NS))
    _, effects = fusion.handle(memory, deadline(20))
    assert points(effects)[0].status == "waiting"


def test_it_goes_on_from_the_step_after_the_stored_one() -> None:
    """Died after step 8, up again before the deadline of step 9: the belief is the stored one, nothing was missed."""
    fusion = centre()
    kept = lived(fusion, 8)
    memory, effects = fusion.handle(fusion.begin(), Started(8 * NS + 600_000_000, kept))
    assert effects == (SetTimer("deadline", 9 * NS + DEADLINE), State("coasting"))
    _, effects = fusion.handle(memory, deadline(9))
    (point,) = points(effects)
    # without a report a third of its belief is that the target stands: models are equals at a start
    assert point.status == "coasting"
    assert np.hypot(*np.subtract(point.mean[:2], place(9))) < 5.0


def test_over_missed_steps_it_coasts_as_the_tracker_does() -> None:
    fusion = centre()
    kept = lived(fusion, 8)
    belief = unpack(kept).beliefs["fix-imm-ukf"]
    assert isinstance(belief, Gaussian)
    memory, effects = fusion.handle(fusion.begin(), Started(12 * NS, kept))
    (point,) = points(effects)
    assert (point.step, point.status, point.reports) == (11, "coasting", 0)
    assert np.reshape(point.covariance, (4, 4))[0, 0] > belief.covariance[0, 0]
    assert effects[1:] == (SetTimer("deadline", 12 * NS + DEADLINE), State("coasting"))
    x, y = place(12)
    _, effects = play(fusion, memory, [*(report(12, id, x=x, y=y) for id, _, _ in SENSORS), deadline(12)])
    (point,) = points(effects)
    assert point.status == "tracking"
    assert point.mean[:2] == pytest.approx((x, y), abs=2.0)


def test_after_a_long_absence_it_waits_and_finds_the_target_again() -> None:
    fusion = centre()
    memory, effects = fusion.handle(fusion.begin(), Started(500 * NS, lived(fusion, 5)))
    assert memory.phase is Phase.WAITING
    assert not [e for e in effects if isinstance(e, Publish)]
    _, effects = play(fusion, memory, [*(report(500, id) for id, _, _ in SENSORS), deadline(500)])
    assert points(effects)[0].mean[:2] == pytest.approx((60.0, 50.0), abs=1.0)


def test_a_target_that_went_elsewhere_meanwhile_is_found_there_whatever_the_prior_was() -> None:
    fusion = centre(prior=PRIOR)
    memory, _ = fusion.handle(fusion.begin(), Started(12 * NS, lived(fusion, 8)))
    for step in range(12, 20):
        heard = [report(step, id, x=95.0, y=15.0) for id, _, _ in SENSORS]
        memory, effects = play(fusion, memory, [*heard, deadline(step)])
    assert points(effects)[0].mean[:2] == pytest.approx((95.0, 15.0), abs=2.0)


def test_a_step_from_the_future_is_not_believed() -> None:
    """The clock of the earlier life was ahead, or the bytes are another run's."""
    fusion = centre()
    _, effects = fusion.handle(fusion.begin(), Started(5 * NS, lived(fusion, 8)))
    assert isinstance(effects[0], Note)
    assert "step 8 is in the future" in effects[0].text


def test_each_tracker_takes_its_own_belief_and_a_stranger_starts_alone() -> None:
    both, kept = centre("spcpf", "fix-imm-ukf"), lived(centre("spcpf"), 8)
    memory, _ = both.handle(both.begin(), Started(9 * NS, kept))
    _, effects = both.handle(memory, deadline(9))
    assert [p.status for p in points(effects)] == ["coasting", "waiting"]
