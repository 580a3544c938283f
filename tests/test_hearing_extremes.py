"""Beliefs in fixes that no head has: of states of another size, and of targets that cannot be."""

from __future__ import annotations

from typing import Any

import msgpack
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion.fixes import ended_of, read
from head.hearing.memory import Memory as HeadMemory
from head.hearing.role import Hearing
from tests.ether import ORIGIN_NS
from tests.hearing import STEP_NS, bank_of, hearing_of, named, pentagon
from tests.test_sink_role import asking, fix, published, told
from trackfield.filters.types import Gaussian
from trackfield.role import NS, Ignored, Publish, Received, SetTimer, Started, Timer
from trackfield.tracking.bank import Bank
from trackfield.tracking.stored import pack
from trackfield.wire.codec import encode
from trackfield.wire.interests import Arrived
from trackfield.wire.passes import FixReport
from trackfield.wire.raw import Raw
from trackfield.wire.raw import pack as pack_raw

PLACES = named(pentagon())
BANK = Bank(**bank_of(PLACES))
RAW = pack_raw([Raw(number, 2.0, -20.0, 1.0) for number in range(5)])
LIMIT = float(np.finfo(np.float32).max)


def told_of(*mean: float, variance: float = 1.0, step: int = 8) -> FixReport:
    return FixReport(1, step, 0, pack(step, None, {"ml": Gaussian(np.array(mean), variance * np.eye(len(mean)))}), RAW)


EXTREMES = [
    told_of(1.0),
    told_of(1.0, 2.0),
    told_of(1.0, 2.0, 3.0),
    told_of(1.0, 2.0, 3.0, 4.0, 5.0),
    told_of(*[0.0] * 12),
    told_of(1e30, 0.0, 1e-20, 0.0),
    told_of(1e7, 0.0, 10.0, 0.0),
    told_of(0.0, 0.0, 2000.0, 0.0),
    told_of(*[LIMIT] * 4, variance=LIMIT),
    told_of(0.0, 0.0, 13.0, 0.0, variance=1e20),
]
SLOW = told_of(20.0, 0.0, 1e-20, 0.0)
"""A target that passed an age ago."""


def leading() -> tuple[HeadMemory, Hearing]:
    """A head that has gathered, and waits for a target."""
    head = hearing_of("n00", PLACES, "fixed", list(PLACES), hand_m=100.0)
    state, _ = head.handle(head.begin(), Started(0))
    state, _ = head.handle(state, Timer(ORIGIN_NS, "lead"))
    assert state.leads is not None
    state, _ = head.handle(state, Timer(ORIGIN_NS + 2 * NS, "gathered"))
    return state, head


@pytest.mark.parametrize("message", EXTREMES)
def test_a_head_does_not_go_on_with_what_cannot_be(message: FixReport) -> None:
    state, head = leading()
    now = ORIGIN_NS + 9 * STEP_NS
    after, effects = head.handle(state, Received(now, Arrived(b"n03", encode(message)), "n00"))
    assert effects == (Ignored("unusable belief"),)
    assert after.leads is state.leads


@pytest.mark.parametrize("message", [*EXTREMES, SLOW])
def test_a_sink_ignores_what_cannot_be(message: FixReport) -> None:
    before = asking()
    after, effects = told(before, message)
    assert Ignored("unusable fix") in effects
    assert (after.fix, after.ended) == (None, ())
    assert published(after)[1] == []


def test_a_stored_fix_that_cannot_be_is_none() -> None:
    with pytest.raises(ValueError, match="another time"):
        read(SLOW, "n00", BANK)
    with pytest.raises(ValueError, match="cannot be"):
        read(EXTREMES[0], "n00", BANK)


sizes = st.sampled_from([0.0, 1e-30, 1e-3, 1.0, 20.0, 999.0, 1e6, 1e20, LIMIT])
numbers = st.builds(lambda size, sign: size * sign, sizes, st.sampled_from([1.0, -1.0]))
raws = st.lists(
    st.builds(Raw, st.integers(0, 5), st.sampled_from([0.0, 1.0, 6.5535]), st.sampled_from([-327.0, 0.0, 327.0]),
              st.sampled_from([0.0, 1.0, 1600.0])), max_size=8
).map(pack_raw)  # fmt: skip
fixes = st.builds(
    lambda mean, variance, step, raw: FixReport(1, step, 0, told_of(*mean, variance=variance).belief, raw),
    st.integers(1, 6).flatmap(lambda n: st.lists(numbers, min_size=n, max_size=n)),
    sizes,
    st.integers(0, 10),
    raws,
)


@settings(max_examples=150, deadline=None)
@given(fixes)
def test_whatever_a_fix_says_all_times_and_places_can_be_told(message: FixReport) -> None:
    """A sink and a head go on for some steps, and what they publish can be packed."""
    state, _ = told(asking(), message)
    points: list[Any] = []
    for _ in range(3):
        state, found = published(state)
        points += found
    head_state, head = leading()
    now = ORIGIN_NS + 10 * STEP_NS
    head_state, effects = head.handle(head_state, Received(now, Arrived(b"n03", encode(message)), "n00"))
    for one in effects:
        if isinstance(one, SetTimer) and one.name == head.steps.timer:
            _, more = head.handle(head_state, Timer(one.at, one.name))
            points += (each.estimate for each in more if isinstance(each, Publish))
    for point in points:
        assert np.isfinite([*point.mean, *point.covariance]).all()
        msgpack.packb((point.at_ns, point.event_ns))


def test_a_fix_of_a_target_that_can_be_is_read() -> None:
    found = read(fix(), "n00", BANK)
    assert abs(ended_of(found, BANK)["ml"].at_ns - BANK.at_ns(20)) < 5 * NS
