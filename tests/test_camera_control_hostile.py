"""Whatever comes to camera control, from a gateway gone mad, a noisy line or strangers: it goes on, and stays small."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from camera.memory import KNOWN, MOST_WAITING, USED
from tests.camera_line import Joined, belief, fix, ignored, item
from trackfield.filters.belief import Particles
from trackfield.role import NS, Received, Started, Store
from trackfield.tracking.stored import pack
from trackfield.wire.codec import encode
from trackfield.wire.outside import Captured, Item, Visca
from trackfield.wire.passes import FixReport

EAST = (5.0, 5.0, 13.4, 0.0)
numbers = st.integers(0, 65535)
any_float = st.floats(width=32, allow_nan=True, allow_infinity=True)


@st.composite
def fixes(draw: st.DrawFn) -> FixReport:
    """Fixes of any numbers, of a belief or of bytes."""
    known = draw(st.one_of(st.binary(max_size=200), st.lists(any_float, min_size=14, max_size=14)))
    if isinstance(known, list):
        body = np.array(known, "<f4").tobytes()
        known = pack(0, None, {"ml": belief(*EAST)}).replace(_body(belief(*EAST)), body)
    raw = draw(st.binary(max_size=64))
    return FixReport(draw(numbers), draw(numbers), draw(st.integers(0, 255)), known, raw)


def _body(one: Any) -> bytes:
    from trackfield.filters.belief import pack as packed

    return packed(one)


items = st.builds(
    Item,
    number=numbers,
    life=numbers,
    task=st.integers(0, 255),
    origin=st.binary(max_size=32),
    message=st.one_of(st.binary(max_size=300), fixes().map(encode)),
)
packets = st.one_of(
    st.binary(min_size=1, max_size=16),
    st.tuples(st.sampled_from([0x90, 0x88, 0xA0, 0x80]), st.integers(0, 255), st.binary(max_size=9)).map(
        lambda parts: bytes([parts[0], parts[1], *parts[2], 0xFF])
    ),
)
messages = st.one_of(
    st.tuples(items, st.sampled_from(["base", "stranger", ""]), st.just("backbone")),
    st.tuples(packets.map(Visca), st.sampled_from(["camera", "stranger"]), st.just("serial")),
    st.tuples(st.builds(Captured, numbers, numbers), st.sampled_from(["video", "stranger"]), st.just("backbone")),
)


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(st.tuples(messages, st.floats(0.0, 0.3)), max_size=30))
def test_it_goes_on_whatever_comes(stream: list[tuple[tuple[Any, str, str], float]]) -> None:
    """Afterwards it still turns the camera for a good fix."""
    both = Joined().run(11.3)
    for (message, sender, medium), after_s in stream:
        both.give(message, sender, medium)
        both.run(both.now / NS + after_s)
        state = both.states["control"]
        assert len(state.items) <= KNOWN
        assert len(state.fixes) <= KNOWN
        assert len(state.used) <= USED
        assert len(state.waiting) <= MOST_WAITING
        assert len(both.stored) < 8192
    both.run(both.now / NS + 30.0)
    step = both.now * 2 // NS
    number = next(one for one in range(65536) if (65535, one) not in both.states["control"].items)
    both.give(item(fix(step, *EAST, number=65535), number=number, life=65535, head="last"))
    both.run(both.now / NS + 5.0)
    assert [values[-1] for values in both.told("aimed") if values[1] == "last"] == ["aimed"]
    assert both.news[-1] == "there"


@given(st.binary(max_size=400))
def test_any_bytes_may_have_been_stored(stored: bytes) -> None:
    role = Joined().roles["control"]
    state, effects = role.handle(role.begin(), Started(0, stored))
    assert state.shots == 0 or b"".join(one.data for one in effects if isinstance(one, Store)) == b""


@pytest.mark.parametrize(
    "known",
    [
        belief(0.0, 0.0, 2000.0, 0.0),
        belief(-3e6, 0.0, 1.0, 0.0),
        belief(0.0, 0.0, 1.0, 0.0, sd_m=1e7),
        Particles(np.full(2, 0.5), np.array([[3e38, 0.0, 0.0, 0.0], [-3e38, 0.0, 0.0, 0.0]])),
        Particles(np.full(2, 0.5), np.array([[3e38, 0.0, 0.0, 0.0], [3e38, 0.0, 0.0, 0.0]])),
        Particles(np.ones(1), np.array([[1.0, 2.0, 3.0]])),
    ],
)
@pytest.mark.filterwarnings("error")
def test_targets_that_cannot_be(known: Any) -> None:
    both = Joined().run(11.3)
    assert list(ignored(both.give(item(fix(20, known={"ml": known}))))) == ["unusable fix"]
    assert both.outcomes == []


def test_a_target_at_the_camera_itself() -> None:
    """Straight below it: the tilt is beyond its reach, and no direction is right for long."""
    both = Joined().run(11.3)
    both.give(item(fix(20, 30.0, -25.0, 0.0, 0.0)))
    assert both.outcomes == [(20, "out of reach")]


def test_thousands_of_fixes_in_a_second_are_all_acknowledged() -> None:
    """Each of another event far from the others, as no field has: the camera stays with one of them."""
    both = Joined().run(11.3)
    for k in range(2000):
        both.give(item(fix(20, -500.0 + k, 20.0 + 7 * (k % 50), 0.0, 0.0, number=k), number=k))
        both.run(both.now / NS + 0.0005)
    assert len(both.acks) == 2000
    assert len(both.stored) < 8192
    both.run(both.now / NS + 20.0)
    assert both.news[-1] == "there"


def test_a_line_that_only_makes_noise_is_a_camera_that_is_lost() -> None:
    both = Joined()
    both.plugged = False
    generator = np.random.default_rng(1)
    for _ in range(200):
        both.run(both.now / NS + 0.01)
        noise = bytes(generator.integers(0, 256, generator.integers(1, 17), dtype=np.uint8))
        both.give(Visca(noise), "camera", "serial")
    assert both.news == ["lost"]


def test_items_of_strangers_are_not_even_acknowledged() -> None:
    both = Joined().run(11.3)
    role, state = both.roles["control"], both.states["control"]
    after, effects = role.handle(state, Received(both.now, item(fix(20, *EAST)), "stranger", "backbone"))
    assert (after, list(ignored(effects)), len(effects)) == (state, ["foreign"], 1)
