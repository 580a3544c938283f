"""Frames in any order, by property: the life they give is that of the right order, as far as anybody can see."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from hypothesis import given, settings
from hypothesis import strategies as st

from tests.puppet import MS, arrival, caught_up, core_of, run
from tests.toys import Feedback, Reply, Request, mix
from trackfield.drivers.engine.conditions import Conditions
from trackfield.drivers.engine.frames import Arrival, Frame, Identity, Output, Refused, Sent, TakenBack, Told, Undone
from trackfield.link.energy import Power
from trackfield.link.fate import Fate
from trackfield.role import (
    NEIGHBOURHOOD,
    NS,
    CancelTimer,
    Effect,
    Event,
    Ignored,
    Note,
    Radio,
    Received,
    Role,
    Sample,
    Send,
    SetTimer,
    State,
    Timer,
)


class Chaos:
    """Whatever happens changes a number, and the number decides what the role does next: it forgives no disorder."""

    kinds = frozenset({"request"})

    def begin(self) -> int:
        return 1

    def handle(self, state: int, event: Event) -> tuple[int, tuple[Effect, ...]]:
        match event:
            case Received(now, Request(value), _):
                chain, delays, other = mix(state, value), (0, MS, 3 * MS), "b"
            case Timer(now, "b"):
                chain, delays, other = mix(state, 3), (-MS, 0, MS), "a"
            case Timer(now):
                chain, delays, other = mix(state, 5), (MS, 2 * MS, 5 * MS), "b"
            case _:
                return mix(state, 7), (SetTimer("a", event.now + 2 * MS),)
        soon = now + delays[chain % 3]
        choices: tuple[tuple[Effect, ...], ...] = (
            (Send(Reply(chain), "hub"), SetTimer("a", now + MS)),
            (Send(Reply(chain), NEIGHBOURHOOD), Send(Reply(7), frozenset({"hub", "x"})), Note(f"{chain}")),
            (CancelTimer("a"), SetTimer(other, soon)),
            (Radio(False), SetTimer("c", now + 2 * MS), State("off")),
            (Radio(True), Sample("sound"), SetTimer("a", now + 4 * MS)),
            (Ignored("late"), CancelTimer("b")),
            (),
        )
        return chain, choices[chain % len(choices)]


class Echo:
    """Its number hangs on the order of all that happened and it tells it, but what it sends does not."""

    kinds = frozenset({"request"})

    def begin(self) -> int:
        return 1

    def handle(self, state: int, event: Event) -> tuple[int, tuple[Effect, ...]]:
        match event:
            case Received(_, Request(value), sender):
                chain = mix(state, value)
                return chain, (Send(Reply(value), sender), State(f"{chain}"))
            case Timer(now):
                chain = mix(state, 5)
                return chain, (Send(Feedback(1, now // MS), "hub"), SetTimer("a", now + 3 * MS), Note(f"{chain}"))
        return state, (SetTimer("a", 3 * MS),)


@dataclass(frozen=True)
class Story:
    """All that anybody can see of a life."""

    state: int
    tally: dict[str, int]
    sent: tuple[Frame, ...]
    told: list[Told | Refused]
    host_late: int
    inversions: int
    record: tuple[list[int], int]


EASY = Conditions()
LAST, BEYOND = 20 * MS, 30 * MS
"""Handling never runs ahead of the last frame's surroundings; all is compared a while later."""


def live(
    role: Role[int],
    batches: Sequence[tuple[Sequence[Arrival], int, bool]],
    horizon_ns: int = NS,
    conditions: Conditions = EASY,
) -> Story:
    """Batches of frames, the number of events handled after each, and whether what is late is caught up with then."""
    core = core_of(role, sense=lambda _, t_ns: t_ns, horizon_ns=horizon_ns, conditions=conditions)
    outputs: list[Output] = []
    for batch, steps, catch in batches:
        for frame in batch:
            core.offer(frame)
        if catch:
            outputs += caught_up(core)
        for _ in range(steps):
            if (key := core.next_key()) is not None and key[0] <= LAST:
                outputs += core.handle_next()
    outputs += caught_up(core)
    outputs += run(core, BEYOND)
    told: list[Told | Refused] = []
    for output in outputs:
        if isinstance(output, Undone):
            told = [t for t in told if t.key < output.key]
        elif isinstance(output, Told | Refused):
            told.append(output)
    sent = live_frames(outputs)
    did = core.record(BEYOND)
    record = did["activity"], did["metered_ns"]
    return Story(core.state, core.tally, tuple(sent), told, core.host_late, core.inversions, record)


def live_frames(outputs: Sequence[Output]) -> list[Frame]:
    """The frames that left and hold in the end, by their identities."""
    left: dict[Identity, Frame] = {}
    for output in outputs:
        if isinstance(output, TakenBack):
            del left[output.frame.identity]
        elif isinstance(output, Sent):
            left[output.frame.identity] = output.frame
    return sorted(left.values(), key=lambda frame: frame.identity)


arrivals = st.lists(
    st.builds(lambda t, value, src: arrival(t * MS, Request(value), src=src),
              st.integers(1, 12), st.integers(0, 50), st.sampled_from("pqr")),
    max_size=10,
    unique_by=lambda a: (a.due_ns, a.frame.src),
)  # fmt: skip


@st.composite
def disorders(draw: st.DrawFn) -> list[tuple[list[Arrival], int, bool]]:
    """Any frames, cut into batches in any order, with any number of events handled in between."""
    rest, batches = draw(arrivals), []
    while rest:
        size = draw(st.integers(1, len(rest)))
        batches.append((rest[:size], draw(st.integers(0, 6)), draw(st.booleans())))
        rest = rest[size:]
    return [([], draw(st.integers(0, 6)), False), *batches]


def in_order(
    role: Role[int], batches: Sequence[tuple[Sequence[Arrival], int, bool]], conditions: Conditions = EASY
) -> Story:
    return live(role, [([a for batch, _, _ in batches for a in batch], 0, False)], conditions=conditions)


def slow(frame: Frame) -> Fate:
    """A frame keeps the radio busy for half a millisecond, or for three."""
    return Fate(None, MS, busy_ns=(3 * MS if frame.broadcast else MS // 2), air_ns=MS // 4, ack_air_ns=MS // 8)


@st.composite
def hard_times(draw: st.DrawFn) -> Conditions:
    """Freezes and jumps of the clock at the instants at which frames come, a small battery, a slow radio, a kill."""
    edges = sorted(draw(st.lists(st.integers(0, 14), max_size=4, unique=True)))
    freezes = tuple((a * MS, b * MS) for a, b in zip(edges[::2], edges[1::2], strict=False))
    when = sorted(draw(st.lists(st.integers(1, 14), max_size=3, unique=True)))
    jumps = tuple((t * MS, draw(st.integers(-4, 4)) * MS) for t in when)
    battery = draw(st.none() | st.integers(1, 60))
    power = Power(6, 5, 4, 1, sample_fj=MS, battery_fj=battery and battery * MS, byte_ns=10_000)
    cost = draw(st.sampled_from([slow, EASY.cost]))
    kill = draw(st.integers(8, 30)) * MS
    return Conditions(0, kill, freezes, jumps, {"field": power}, {"field": draw(st.integers(0, 2))}, cost)


@settings(max_examples=400)
@given(disorders())
def test_any_order_gives_the_same_life(batches: list[tuple[list[Arrival], int, bool]]) -> None:
    """State, counters, telemetry and frames are those of a life in order; what left by mistake is taken back."""
    right, real = in_order(Chaos(), batches), live(Chaos(), batches)
    assert (right.host_late, right.inversions) == (0, 0)
    assert replace(real, inversions=0) == right


@settings(max_examples=200)
@given(disorders())
def test_order_leaves_no_trace_if_what_is_sent_does_not_hang_on_it(
    batches: list[tuple[list[Arrival], int, bool]],
) -> None:
    right, real = in_order(Echo(), batches), live(Echo(), batches)
    assert replace(real, inversions=0) == right


@settings(max_examples=200)
@given(disorders(), st.integers(0, 6))
def test_however_short_the_memory_every_frame_is_accounted_for(
    batches: list[tuple[list[Arrival], int, bool]], horizon_ms: int
) -> None:
    real = live(Chaos(), batches, horizon_ns=horizon_ms * MS)
    due = sum(len(batch) for batch, _, _ in batches)
    assert real.tally.get("delivered", 0) + real.tally.get("asleep", 0) + real.host_late == due


@settings(max_examples=600)
@given(disorders(), hard_times())
def test_any_order_gives_the_same_life_in_hard_times(
    batches: list[tuple[list[Arrival], int, bool]], conditions: Conditions
) -> None:
    """Over jumps of the clock, freezes, a queue, an empty battery and a kill: that of the right order."""
    mine = [([a for a in batch if a.due_ns < conditions.kill_ns], steps, catch) for batch, steps, catch in batches]
    right, real = in_order(Chaos(), mine, conditions), live(Chaos(), mine, conditions=conditions)
    assert (right.host_late, right.inversions) == (0, 0)
    assert replace(real, inversions=0) == right
