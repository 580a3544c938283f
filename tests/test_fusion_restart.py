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
from trackfield.filters.belief import Modes, Particles, moments
from trackfield.filters.types import Gaussian
from trackfield.role import NS, Note, Publish, SetTimer, Started, State, Store
from trackfield.tracking.stored import pack, unpack

BELIEF = Gaussian(np.array([1.0, 2.0, 3.0, 4.0]), np.eye(4) + 0.25)


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
    modes = Modes(np.array([0.25, 0.75]), np.tile(BELIEF.mean, (2, 1)), np.tile(BELIEF.covariance, (2, 1, 1)))
    cloud = Particles(np.full(4, 0.25), np.arange(16.0).reshape(4, 4))
    stored = unpack(pack(7, 52.5, {"a": BELIEF, "b": None, "c": modes, "d": cloud}))
    assert (stored.step, stored.threshold_db, list(stored.beliefs)) == (7, 52.5, ["a", "b", "c", "d"])
    assert stored.beliefs["b"] is None
    for before, after in ((BELIEF, stored.beliefs["a"]), (modes, stored.beliefs["c"]), (cloud, stored.beliefs["d"])):
        assert type(after) is type(before)
        assert after is not None
        assert [part.tolist() for part in after] == [part.tolist() for part in before]


def test_the_bytes_are_those_of_the_belief_and_little_more() -> None:
    assert len(pack(65535, 52.5, {"ekf": BELIEF})) < 56 + 30
    fusion = centre("imm-ukf", "ekf")
    assert len(lived(fusion, 3)) < 4 * 60 + 56 + 50


@pytest.mark.parametrize("number", [np.nan, np.inf, 1e39])
def test_a_track_that_is_beyond_all_numbers_leaves_nothing_to_the_next_life(number: float) -> None:
    lost = BELIEF._replace(covariance=BELIEF.covariance * number)
    assert unpack(pack(7, None, {"a": lost, "b": BELIEF})).beliefs["a"] is None


GOOD = struct.pack("<14f", 1, 2, 3, 4, 1, 0, 0, 0, 1, 0, 0, 1, 0, 1)


def belief(form: object = 1, n: object = 4, data: object = GOOD) -> bytes:
    packed: bytes = msgpack.packb((2, 3, None, {"a": (form, n, data)}))
    return packed


def test_those_here_are_good_but_for_what_is_wrong_with_them() -> None:
    after = unpack(belief()).beliefs["a"]
    assert isinstance(after, Gaussian)
    assert after.mean.tolist() == [1.0, 2.0, 3.0, 4.0]


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"\xc1", "not MessagePack"),
        (b"", "not MessagePack"),
        (msgpack.packb(5), "not an array"),
        (msgpack.packb((1, 2)), "not an array"),
        (msgpack.packb((1, 3, None, {})), "version 1; expected 2"),
        (msgpack.packb((2, -3, None, {})), "step -3"),
        (msgpack.packb((2, 3.5, None, {})), "step 3.5"),
        (msgpack.packb((2, 3, "x", {})), "threshold x"),
        (msgpack.packb((2, 3, float("nan"), {})), "threshold nan"),
        (msgpack.packb((2, 3, None, [])), "no beliefs"),
        (msgpack.packb((2, 3, None, {"a": GOOD})), "not an array of form, dimension and bytes"),
        (msgpack.packb((2, 3, None, {"a": (1, 4, GOOD, 1)})), "not an array of form, dimension and bytes"),
        (belief(form=True), "not an array of form, dimension and bytes"),
        (belief(n=4.0), "not an array of form, dimension and bytes"),
        (belief(data="x" * 56), "not an array of form, dimension and bytes"),
        (belief(form=[]), "not an array of form, dimension and bytes"),
        (belief(form=7), "form 7; expected 1, 2 or 3"),
        (belief(n=3), "56 bytes; expected 36"),
        (belief(n=2**63), "dimension 9223372036854775808"),
        (belief(data=GOOD[:-1]), "55 bytes; expected 56"),
        (belief(data=struct.pack("<14f", *[float("inf")] * 14)), "not finite"),
        (belief(data=struct.pack("<14f", *[-1.0] * 14)), "negative variance"),
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
    fusion, good = centre(), pack(7, None, {"imm-ukf": BELIEF})
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
    assert point.status == "coasting"
    assert point.mean[:2] == pytest.approx(place(9), abs=1.0)


def test_over_missed_steps_it_coasts_as_the_tracker_does() -> None:
    fusion = centre()
    kept = lived(fusion, 8)
    belief = unpack(kept).beliefs["imm-ukf"]
    assert isinstance(belief, Modes)
    memory, effects = fusion.handle(fusion.begin(), Started(12 * NS, kept))
    (point,) = points(effects)
    assert (point.step, point.status, point.reports) == (11, "coasting", 0)
    assert np.reshape(point.covariance, (4, 4))[0, 0] > moments(belief).covariance[0, 0]
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
    both, kept = centre("spcpf", "imm-ukf"), lived(centre("spcpf"), 8)
    memory, _ = both.handle(both.begin(), Started(9 * NS, kept))
    _, effects = both.handle(memory, deadline(9))
    assert [p.status for p in points(effects)] == ["coasting", "waiting"]
