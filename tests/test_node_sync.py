"""What a node makes of the time that it learns: event by event, and in whole lives with a clock that is off."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from node.role import Memory, Node, Phase
from tests.puppet import MS, frames, run
from tests.sensing import hearing
from tests.test_timesync import CONFIG, START_NS, asking, reply, resting
from trackfield.draw import uniform
from trackfield.drivers.engine.core import Core
from trackfield.drivers.engine.frames import Arrival, Frame, Output, Refused, Told
from trackfield.link.clock import Clock
from trackfield.role import (
    NS,
    CancelTimer,
    Corrected,
    Effect,
    Ignored,
    IllegalEvent,
    Radio,
    Received,
    Role,
    Sample,
    Sampled,
    Send,
    SetTimer,
    Started,
    State,
    Timer,
)
from trackfield.wire.codec import decode, encode
from trackfield.wire.messages import Doa, SyncReply, SyncRequest

NODE = Node(step_ns=NS, threshold_db=52.5, centre="fusion", sync=CONFIG)
LOUD = hearing(60.0, 123.45)


# --- a round, event by event --------------------------------------------------------------------------------------


def started(now: int = 0) -> Memory:
    return NODE.handle(NODE.begin(), Started(now))[0]


def node_asking(exchange: int = 1, at: int = NS) -> Memory:
    """Its request ``exchange`` of the first round left at ``at``."""
    return replace(started(), time=asking(exchange, at))


def test_a_round_from_the_first_request_to_the_correction() -> None:
    """Three exchanges in slots of 200 ms, of which the second is the fastest; the centre is 250 ms ahead."""
    ahead, (due, second, third, end) = 250 * MS, (START_NS + slot * 200 * MS for slot in range(4))
    story: list[tuple[Any, tuple[Effect, ...]]] = [
        (Started(0), (State("asleep"), Radio(False), SetTimer("sync", due), Sample("wake-up"))),
        (Sampled(0, "wake-up", NS), (SetTimer("step", NS), SetTimer("sync", due))),
        (Timer(due, "sync"), (Radio(True), Send(SyncRequest(1, due // 1000), "fusion"), SetTimer("sync", second))),
        (reply(1, due, there=30 * MS, back=10 * MS, ahead=ahead), (Radio(False),)),
        (Timer(second, "sync"), (Radio(True), Send(SyncRequest(2, second // 1000), "fusion"), SetTimer("sync", third))),
        (reply(2, second, there=4 * MS, back=6 * MS, ahead=ahead), (Radio(False),)),
        (Timer(third, "sync"), (Radio(True), Send(SyncRequest(3, third // 1000), "fusion"), SetTimer("sync", end))),
        (reply(3, third, there=4 * MS, back=10 * MS, ahead=ahead), (Radio(False),)),
        (Timer(end, "sync"), (Corrected(249 * MS), SetTimer("sync", end + 60 * NS), Sample("wake-up"))),
        # Step 100 and the round ahead of it (3 exchanges of 200 ms) in local time.
        (Sampled(end, "wake-up", 99 * NS), (SetTimer("step", 100 * NS - 249 * MS), SetTimer("sync", 98_400 * MS))),
    ]
    state = NODE.begin()
    for event, expected in story:
        state, effects = NODE.handle(state, event)
        # Requests carry microseconds; so the correction is good to one.
        assert [_in_ms(e) for e in effects] == [_in_ms(e) for e in expected], event


def _in_ms(effect: Effect) -> Effect:
    match effect:
        case Corrected(ns):
            return Corrected(round(ns / MS))
        case SetTimer("step", at):
            return SetTimer("step", round(at / MS))
    return effect


def test_its_receiver_stays_on_for_the_next_if_a_reply_does_not_come() -> None:
    _, effects = NODE.handle(node_asking(1), Timer(NS + 200 * MS, "sync"))
    again = NS + 200 * MS
    assert effects == (Send(SyncRequest(2, again // 1000), "fusion"), SetTimer("sync", again + 200 * MS))


def test_a_round_without_any_reply_keeps_what_was_known_and_is_repeated_soon() -> None:
    before = node_asking(3)
    before = replace(before, phase=Phase.AWAKE, time=replace(before.time, correction_ns=7 * MS))
    now = NS + 200 * MS
    state, effects = NODE.handle(before, Timer(now, "sync"))
    assert state.time.correction_ns == 7 * MS
    assert now + 600 * MS <= state.time.due_ns <= now + 1800 * MS
    assert effects == (Radio(False), SetTimer("sync", state.time.due_ns), SetTimer("step", 2 * NS - 7 * MS))


def test_a_reply_of_no_use_is_ignored_and_it_still_waits() -> None:
    state = node_asking(2)
    for message, sender, reason in [
        (SyncReply(2, NS // 1000, 10, 10), "n001", "foreign"),
        (SyncReply(1, NS // 1000, 10, 10), "fusion", "outdated"),
        (SyncReply(2, NS // 1000, 10, 9), "fusion", "implausible"),
        (SyncRequest(2, 0), "fusion", "unexpected"),
    ]:
        assert NODE.handle(state, Received(NS + 5 * MS, message, sender)) == (state, (Ignored(reason),))
    assert NODE.handle(state, reply(2, NS, there=5 * MS, back=5 * MS, ahead=0))[1] == (Radio(False),)


def test_it_may_ask_another_than_the_one_it_reports_to() -> None:
    """The centre's own time is then of no use to it."""
    node = Node(step_ns=NS, threshold_db=52.5, centre="fusion", sync={**CONFIG, "reference": "head"})
    state, _ = node.handle(node.begin(), Started(0))
    state, effects = node.handle(state, Timer(START_NS, "sync"))
    assert Send(SyncRequest(1, START_NS // 1000), "head") in effects
    answer = reply(1, START_NS, there=5 * MS, back=5 * MS, ahead=0)
    assert node.handle(state, answer)[1] == (Ignored("foreign"),)
    assert node.handle(state, replace(answer, sender="head"))[1] == (Radio(False),)
    awake = replace(state, phase=Phase.AWAKE)
    assert Send(Doa(1, 123.45, 60.0), "fusion") in node.handle(awake, Sampled(NS, "sound", LOUD))[1]


def test_a_broken_driver_is_told_so() -> None:
    for state in (started(), node_asking()):
        with pytest.raises(IllegalEvent):
            NODE.handle(state, Timer(2 * NS, "nap"))


def test_it_consumes_replies() -> None:
    assert NODE.kinds == {"sync-reply"}


# --- while it sleeps and while it listens -------------------------------------------------------------------------


def rested(phase: Phase = Phase.ASLEEP, *, correction: int = 0, due: int = 90 * NS) -> Memory:
    return Memory(phase, 52.5, time=resting(correction, due=due))


@pytest.mark.parametrize(
    ("window_s", "round_s"),
    [
        (40.0, 39.4),  # sleeps long: a round ahead of it
        (21.3, 20.7),
        (21.2, 90.0),  # a nap of no more than two rounds: when it is due anyway
        (15.0, 90.0),
    ],
)
def test_a_sleeper_synchronises_ahead_of_waking(window_s: float, round_s: float) -> None:
    _, effects = NODE.handle(rested(), Sampled(20 * NS, "wake-up", round(window_s * NS)))
    assert effects[1] == SetTimer("sync", round(round_s * NS))


def test_one_that_will_hear_nothing_needs_no_time() -> None:
    _, effects = NODE.handle(rested(), Sampled(20 * NS, "wake-up", None))
    assert effects == (CancelTimer("sync"),)


def test_a_correction_while_awake_moves_the_next_step() -> None:
    """At 5.95 s by its clock it learns that it is 6.05 s: step 6 has gone by, 7 is 950 ms away."""
    state = replace(node_asking(3, at=5750 * MS), phase=Phase.REPORTING, done=((1, 5),))
    after, _ = NODE.handle(state, reply(3, 5750 * MS, there=5 * MS, back=5 * MS, ahead=100 * MS))
    after, effects = NODE.handle(after, Timer(5950 * MS, "sync"))
    assert effects == (Corrected(100 * MS), SetTimer("sync", 65950 * MS), SetTimer("step", 6900 * MS))
    _, effects = NODE.handle(after, Timer(6900 * MS, "step"))
    assert effects == (Sample("sound"),)
    _, effects = NODE.handle(after, Sampled(6900 * MS, "sound", LOUD))
    assert effects == (Send(Doa(7, 123.45, 60.0), "fusion"), SetTimer("step", 7900 * MS))


def test_a_correction_that_moves_time_back_repeats_no_step() -> None:
    """It did steps 1 to 5 and learns that it is 3.0 s: it waits for step 6."""
    state = replace(node_asking(3, at=5 * NS), phase=Phase.REPORTING, done=((1, 5),))
    state, _ = NODE.handle(state, reply(3, 5 * NS, there=5 * MS, back=5 * MS, ahead=-2010 * MS))
    after, effects = NODE.handle(state, Timer(5010 * MS, "sync"))
    assert after.time.correction_ns == -2010 * MS
    assert SetTimer("step", 6 * NS + 2010 * MS) in effects


def test_a_clock_that_was_an_hour_ahead_does_not_silence_it_for_an_hour() -> None:
    """Steps 3601 to 3603 were done by mistake; the right ones are still to do."""
    state = replace(node_asking(3, at=3603 * NS), phase=Phase.REPORTING, done=((1, 2), (3601, 3603)))
    state, _ = NODE.handle(state, reply(3, 3603 * NS, there=5 * MS, back=5 * MS, ahead=-3600 * NS))
    _, effects = NODE.handle(state, Timer(3603 * NS + 200 * MS, "sync"))
    assert SetTimer("step", 3604 * NS) in effects  # step 4 by the right time


# --- whole lives --------------------------------------------------------------------------------------------------

Delay = Callable[[int], int]


class Life:
    """A node with a clock of its own, heard and answered by a centre whose clock is true."""

    def __init__(
        self,
        node: Role[Any],
        clock: Clock,
        windows: list[tuple[int, int]],
        *,
        there: Delay = lambda _: 5 * MS,
        back: Delay = lambda _: 5 * MS,
        lost: Callable[[int], bool] = lambda _: False,
    ) -> None:
        self.clock, self.windows, self.there, self.back, self.lost = clock, windows, there, back, lost
        self.core = Core(node, owner="n007", clock=clock, sense=self.sense)
        self.outputs: list[Output] = []
        self.exchanges = 0

    def sense(self, name: str, t: int) -> Any:
        later = [w for w in self.windows if w[1] >= t]
        if name == "wake-up":
            return self.clock.local(later[0][0]) if later else None
        return LOUD if later and later[0][0] <= t else None

    def live(self, until_ns: int) -> Life:
        while (key := self.core.next_key()) is not None and key[0] <= until_ns:
            outputs = run(self.core, key[0])
            self.outputs += outputs
            for frame in frames(outputs):
                if frame.kind == "sync-request":
                    self.answer(frame)
        return self

    def answer(self, frame: Frame) -> None:
        i, self.exchanges = self.exchanges, self.exchanges + 1
        if not self.lost(frame.sent_ns):
            request, t1 = decode(frame.payload), frame.sent_ns + self.there(i)
            message = SyncReply(request.exchange, request.sent_us, t1 // 1000, t1 // 1000)
            answer = Frame("fusion", 0, "sync-reply", t1, 0, "n007", "field", encode(message))
            self.core.offer(Arrival(t1 + self.back(i), answer))

    @property
    def reports(self) -> list[tuple[int, int]]:
        """(true time, step) of each."""
        return [(f.sent_ns, decode(f.payload).step) for f in frames(self.outputs) if f.kind == "doa"]

    def told(self, kind: type) -> Iterator[tuple[int, Any]]:
        return ((o.key[0], o.effect) for o in self.outputs if isinstance(o, Told) and isinstance(o.effect, kind))

    @property
    def errors_ms(self) -> list[float]:
        """The error of each correction at its time."""
        return [(self.clock.local(t) + c.correction_ns - t) / MS for t, c in self.told(Corrected)]


def test_with_a_symmetric_radio_a_wrong_clock_reports_at_the_right_times() -> None:
    """40 ms off, 50 ppm fast: asleep till 29.5 s, awake for 6 s, and again from 299.5 s to 400.5 s."""
    windows = [(29_500 * MS, 35_500 * MS), (299_500 * MS, 400_500 * MS)]
    life = Life(NODE, Clock(40 * MS, 50_000), windows).live(500 * NS)
    steps = [step for _, step in life.reports]
    assert steps == [*range(30, 36), *range(300, 401)]
    for t, step in life.reports:
        assert abs(t - step * NS) < 62 * 50_000  # what it drifts in a minute and a round, 3 ms
    asked = [f.sent_ns / NS for f in frames(life.outputs) if f.kind == "sync-request"]
    assert [asked[1] - asked[0], asked[2] - asked[1]] == pytest.approx([0.2, 0.2], abs=1e-4)
    assert asked[::3] == pytest.approx([28.9, 298.9, 359.5], abs=0.02)  # ahead of each waking, after a minute awake
    assert max(map(abs, life.errors_ms)) < 0.02


def test_its_receiver_is_on_while_it_waits_and_at_no_other_time() -> None:
    life = Life(NODE, Clock(40 * MS, 50_000), [(29_500 * MS, 35 * NS)]).live(60 * NS)
    switched = [(t, radio.on) for t, radio in life.told(Radio)]
    assert [on for _, on in switched] == [False, *[True, False] * 3]
    assert [b - a for (a, on), (b, _) in pairwise(switched) if on] == [10 * MS] * 3


def test_without_any_reply_it_goes_on_by_its_own_clock_and_tries_again() -> None:
    life = Life(NODE, Clock(40 * MS), [(0, 40_500 * MS)], lost=lambda t: t < 20 * NS).live(45 * NS)
    assert [step for _, step in life.reports] == list(range(1, 41))
    assert {t - step * NS for t, step in life.reports if step <= 20} == {-40 * MS}
    assert max(abs(t - step * NS) for t, step in life.reports if step >= 24) < 1000  # a microsecond
    assert len([*life.told(Corrected)]) == 1
    assert not [o for o in life.outputs if isinstance(o, Refused)]


@settings(max_examples=150, deadline=None)
@given(
    st.integers(-5000, 5000).map(lambda ms: ms * MS + 123_457),
    st.integers(-200_000, 200_000),
    st.integers(0, 5),
    st.lists(st.tuples(st.integers(0, 60), st.integers(1, 20)), max_size=4),
)
def test_whatever_its_clock_it_reports_no_step_twice_and_goes_on(
    offset_ns: int, drift_ppb: int, seed: int, wakings: list[tuple[int, int]]
) -> None:
    """Replies come after up to 0.6 s, so that some are given up, but one of each round counts; so steps come right."""
    windows, t = [], 0
    for pause, length in wakings:
        windows.append(((t + pause) * NS, (t + pause + length) * NS))
        t += pause + length + 1

    def delay(purpose: str) -> Delay:
        return lambda i: MS + int(uniform(seed, purpose, i) ** 4 * (300 if i % 3 else 90) * MS)

    life = Life(NODE, Clock(offset_ns, drift_ppb), windows, there=delay("there"), back=delay("back"))
    life.live((t + 20) * NS)
    steps = [step for _, step in life.reports]
    assert len(set(steps)) == len(steps)
    for from_ns, until_ns in windows:
        # After the first seconds, in which it may still be wrong, it misses nothing: no correction is off by more than
        # half of the longest delay that counts, 100 ms.
        wanted = [step for step in range(1, t) if from_ns + NS // 3 <= step * NS <= until_ns - NS // 3]
        assert set(wanted[8:] if from_ns < 10 * NS else wanted) <= set(steps)


# --- how good it is -----------------------------------------------------------------------------------------------


def share_beyond(error_ms: float, exchanges: int) -> float:
    """Of the errors of the fastest of exchanges that take 4 ms and an exponential of mean 3 ms each way.

    The sum s of both exponentials exceeds any value with probability G(s) = (1 + s/3) exp(-s/3), and the error is
    uniform within s/2 either way; so for the smallest of K sums it is beyond e with the integral of 2e/s^2 G(s)^K
    over s from 2e.
    """
    s = np.geomspace(2 * error_ms, 100, 20_001)
    density = 2 * error_ms / s**2 * ((1 + s / 3) * np.exp(-s / 3)) ** exchanges
    return float(np.trapezoid(density, s))


@pytest.mark.parametrize(("exchanges", "p50_ms", "p99_ms"), [(8, 0.2983, 1.605), (32, 0.1400, 0.6988)])
def test_the_error_of_the_fastest_of_many_exchanges(exchanges: int, p50_ms: float, p99_ms: float) -> None:
    trials = 2000
    node = Node(step_ns=NS, threshold_db=52.5, centre="fusion", sync={**CONFIG, "exchanges": exchanges})
    errors = []
    for trial in range(trials):
        draws = np.random.default_rng([exchanges, trial]).exponential(3 * MS, (2, exchanges))
        there, back = (draws + 4 * MS).astype(int).tolist()
        life = Life(node, Clock(30 * MS), [(0, NS)], there=there.__getitem__, back=back.__getitem__)
        errors += life.live(9 * NS).errors_ms
    assert len(errors) == trials
    print(f"K = {exchanges}: p50 and p99", np.quantile(np.abs(errors), [0.5, 0.99]), "ms")
    for error_ms, share in [(p50_ms, 0.5), (p99_ms, 0.01)]:
        assert share_beyond(error_ms, exchanges) == pytest.approx(share, rel=0.01)
        found = np.mean(np.abs(errors) > error_ms)
        assert abs(found - share) < 4 * np.sqrt(share * (1 - share) / trials)
    assert abs(np.mean(errors)) < 4 * np.std(errors) / np.sqrt(trials)
