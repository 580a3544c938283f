"""The fusion centre's life as plain calls: which reports count, and what it publishes when."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from math import atan2, degrees
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion.memory import TRANSITIONS, Memory, Phase
from fusion.role import Fusion
from tests.sensing import arrays
from tests.toys import Request
from trackfield.filters.bootstrap import Bootstrap
from trackfield.filters.types import Reports
from trackfield.role import (
    NS,
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    PortRead,
    Publish,
    Received,
    Sampled,
    Send,
    SetTimer,
    Started,
    State,
    Store,
    Timer,
    TrackPoint,
)
from trackfield.tracking.points import MAX_PARTICLES
from trackfield.tracking.stored import pack
from trackfield.wire.messages import Doa, SyncReply, SyncRequest

SENSORS = (("n0", 0.0, 0.0), ("n1", 100.0, 0.0), ("n2", 0.0, 100.0), ("n3", 100.0, 100.0))
PRIOR = {"mean": (50.0, 50.0, 0.0, 0.0), "sd": (20.0, 20.0, 4.0, 4.0)}
DEADLINE = 300_000_000


def centre(*trackers: str, prior: Mapping[str, Any] | None = None, **changes: Any) -> Fusion:
    settings: dict[str, Any] = {
        "trackers": trackers or ("imm-ukf",),
        "sensors": SENSORS,
        "step_ns": NS,
        "deadline_ns": DEADLINE,
        "sensing": arrays(3.0),
        "seed": 1,
        "prior": prior,
        "target": "bus",
    }
    return Fusion(**{**settings, **changes})


def started(fusion: Fusion) -> Memory:
    return fusion.handle(fusion.begin(), Started(0))[0]


def report(step: int, sensor: str, *, x: float = 60.0, y: float = 50.0, delay_ns: int = 1_000_000) -> Received:
    """What ``sensor`` says of a target at (x, y) m, with the wire's resolution."""
    where = {id: (east, north) for id, east, north in SENSORS}
    east, north = where.get(sensor, (0.0, 0.0))
    bearing = round(degrees(atan2(x - east, y - north)) % 360.0, 2) % 360.0
    return Received(step * NS + delay_ns, Doa(step, bearing, 55.0), sensor)


def deadline(step: int) -> Timer:
    return Timer(step * NS + DEADLINE, "deadline")


def play(fusion: Fusion, memory: Memory, events: Iterable[Event]) -> tuple[Memory, list[Effect]]:
    effects: list[Effect] = []
    for event in events:
        memory, asked = fusion.handle(memory, event)
        effects += asked
    return memory, effects


def points(effects: Iterable[Effect]) -> list[TrackPoint]:
    return [effect.estimate for effect in effects if isinstance(effect, Publish)]


# --- step by step -------------------------------------------------------------------------------------------------


def test_it_waits_for_the_first_deadline() -> None:
    fusion = centre()
    memory, effects = fusion.handle(fusion.begin(), Started(0))
    assert memory.phase is Phase.WAITING
    assert effects == (SetTimer("deadline", NS + DEADLINE), State("waiting"))
    assert fusion.kinds == {"doa", "sync-request"}


def test_without_prior_it_starts_from_the_first_reports_that_give_a_fix() -> None:
    """Nothing is heard in step 1, one bearing in step 2, three in step 3, none in step 4, two in step 5."""
    fusion = centre()
    memory, effects = started(fusion), list[Effect]()
    heard = {2: ("n0",), 3: ("n0", "n1", "n2"), 5: ("n1", "n3")}
    for step in range(1, 6):
        memory, asked = play(fusion, memory, [*(report(step, id) for id in heard.get(step, ())), deadline(step)])
        assert [e for e in asked if isinstance(e, SetTimer)] == [SetTimer("deadline", (step + 1) * NS + DEADLINE)]
        assert asked[-1] == State(memory.phase.value) or not isinstance(asked[-1], State)
        effects += asked
    assert [(p.step, p.status, p.reports) for p in points(effects)] == [
        (1, "waiting", 0), (2, "waiting", 1), (3, "tracking", 3), (4, "coasting", 0), (5, "tracking", 2)
    ]  # fmt: skip
    assert [e.name for e in effects if isinstance(e, State)] == ["tracking", "coasting", "tracking"]
    assert all((p.tracker, p.target) == ("imm-ukf", "bus") for p in points(effects))


def test_while_it_waits_it_publishes_that_it_does_and_nothing_more() -> None:
    fusion = centre()
    _, effects = fusion.handle(started(fusion), deadline(1))
    point = TrackPoint("imm-ukf", "bus", NS, "waiting", step=1)
    kept = Store(pack(1, None, {"imm-ukf": None}))
    assert effects == (Publish(point), kept, SetTimer("deadline", 2 * NS + DEADLINE))


def test_its_clock_is_the_reference_for_who_asks() -> None:
    fusion = centre()
    asked = Received(5_000_123_999, SyncRequest(7, -42), "n3")
    for memory in (started(fusion), play(fusion, started(fusion), [deadline(1)])[0]):
        after, effects = fusion.handle(memory, asked)
        assert after is memory
        assert effects == (Send(SyncReply(7, -42, 5_000_123, 5_000_123), "n3"),)


def test_bearings_that_cross_are_where_the_target_is() -> None:
    """Four noiseless bearings to (60, 50) m: what is left is their rounding to 0.01 degrees, over 80 m or less."""
    fusion = centre()
    _, effects = play(fusion, started(fusion), [*(report(1, id) for id, _, _ in SENSORS), deadline(1)])
    (point,) = points(effects)
    assert point.mean[:2] == pytest.approx((60.0, 50.0), abs=0.1)
    assert len(point.mean) == 4
    covariance = np.reshape(point.covariance, (4, 4))
    assert (covariance == covariance.T).all()
    # sd of a bearing 3 degrees, four of them from 64 to 78 m: about 71 m * 0.052 / sqrt(2) per axis
    assert np.sqrt(np.diag(covariance)[:2]) == pytest.approx(2.6, rel=0.15)


def test_with_a_prior_it_has_a_track_from_the_start() -> None:
    fusion = centre(prior=PRIOR)
    memory, effects = fusion.handle(started(fusion), deadline(1))
    assert memory.phase is Phase.COASTING
    (point,) = points(effects)
    assert (point.status, point.mean) == ("coasting", pytest.approx((50.0, 50.0, 0.0, 0.0)))
    assert np.reshape(point.covariance, (4, 4))[0, 0] >= 20.0**2


def test_after_a_loss_it_waits_again_and_finds_the_target_elsewhere() -> None:
    """The target jumps from (30, 30) to (85, 90) m: the track is given up for the fix of new reports."""
    fusion = centre()
    memory, effects = started(fusion), list[Effect]()
    for step in range(1, 21):
        x, y = (30.0, 30.0) if step <= 10 else (85.0, 90.0)
        memory, asked = play(fusion, memory, [*(report(step, id, x=x, y=y) for id, _, _ in SENSORS), deadline(step)])
        effects += asked
    before, after = points(effects)[9], points(effects)[19]
    assert before.mean[:2] == pytest.approx((30.0, 30.0), abs=2.0)
    assert after.mean[:2] == pytest.approx((85.0, 90.0), abs=2.0)


def test_each_tracker_publishes_a_point_in_every_step() -> None:
    fusion = centre("spcpf", "imm-ukf", "bootstrap", prior=PRIOR)
    memory, effects = play(fusion, started(fusion), [report(1, "n0"), deadline(1)])
    assert [p.tracker for p in points(effects)] == ["spcpf", "imm-ukf", "bootstrap"]
    assert {(p.step, p.status, p.reports) for p in points(effects)} == {(1, "tracking", 1)}
    assert memory.phase is Phase.TRACKING


def test_trackers_side_by_side_do_not_disturb_each_other() -> None:
    """Each draws by its own name: what one publishes alone, it publishes in company too."""
    events = [
        event for step in (1, 2, 3) for event in (*(report(step, id) for id in ("n0", "n1", "n2")), deadline(step))
    ]
    together = centre("spcpf", "imm-ukf", prior=PRIOR)
    published = points(play(together, started(together), events)[1])
    for name in ("spcpf", "imm-ukf"):
        alone = centre(name, prior=PRIOR)
        assert points(play(alone, started(alone), events)[1]) == [p for p in published if p.tracker == name]


def test_the_seed_decides_what_is_random() -> None:
    events = [*(report(1, id) for id in ("n0", "n1")), deadline(1)]
    means = []
    for seed in (1, 1, 2):
        fusion = centre("spcpf", prior=PRIOR, seed=seed)
        means.append(points(play(fusion, started(fusion), events)[1])[0].mean)
    assert means[0] == means[1] != means[2]


def test_of_many_particles_a_few_are_published() -> None:
    fusion = centre("bootstrap", prior=PRIOR)
    _, effects = play(fusion, started(fusion), [report(1, "n0"), report(1, "n1"), deadline(1)])
    (point,) = points(effects)
    cloud = np.frombuffer(point.particles, "<f4").reshape(-1, 2)
    assert 0 < len(cloud) <= MAX_PARTICLES < Bootstrap().n
    assert np.median(cloud, axis=0) == pytest.approx(point.mean[:2], abs=5.0)


# --- which reports count ------------------------------------------------------------------------------------------


def test_a_report_counts_for_its_step_whenever_it_comes_before_that_deadline() -> None:
    """A report of step 2 that comes before the deadline of step 1, from a node whose clock is ahead."""
    fusion = centre()
    early = report(2, "n0", delay_ns=-900_000_000)
    memory, effects = play(fusion, started(fusion), [early, report(1, "n1"), deadline(1), report(2, "n1"), deadline(2)])
    assert [(p.step, p.reports) for p in points(effects)] == [(1, 1), (2, 2)]
    assert not memory.progress.collected.ahead


@pytest.mark.parametrize(
    ("event", "reason"),
    [
        (Received(2 * NS, Request(1), "n0"), "unexpected"),
        (report(1, "n1", delay_ns=DEADLINE + 1), "late"),
        (report(0, "n1"), "late"),
        (report(2, "stranger"), "unknown sensor"),
        (report(4, "n1", delay_ns=-NS - 1), "from the future"),
        (report(65535, "n1", delay_ns=-65533 * NS), "from the future"),
        (report(2, "n0", x=0.0), "repeated"),
    ],
)
def test_a_report_of_no_use_is_ignored_for_a_reason(event: Event, reason: str) -> None:
    """After the deadline of step 1, with n0's report of step 2 in hand."""
    fusion = centre()
    memory, _ = play(fusion, started(fusion), [deadline(1), report(2, "n0")])
    after, effects = fusion.handle(memory, event)
    assert effects == (Ignored(reason),)
    assert after is memory


def test_a_report_of_the_step_ahead_is_taken_however_early_in_the_step_before() -> None:
    fusion = centre()
    memory = started(fusion)
    after, effects = fusion.handle(memory, report(4, "n1", delay_ns=-NS))
    assert effects == ()
    assert after.progress.collected.ahead[4]["n1"].step == 4


def test_a_report_due_at_the_deadline_is_late_only_after_it() -> None:
    """The driver hands over the frame first; the role goes by what it fused, not by the clock."""
    fusion = centre()
    _, effects = play(fusion, started(fusion), [report(1, "n0", delay_ns=DEADLINE), deadline(1)])
    assert points(effects)[0].reports == 1


class Spy:
    """In a tracker's place: writes down what it is given, and a draw."""

    def __init__(self) -> None:
        self.seen: list[tuple[Reports, float, float]] = []

    def begin(self, prior: object) -> None:
        pass

    def belief(self, state: object) -> None:
        pass

    def closed(self, state: object) -> None:
        pass

    def step(self, state: object, reports: Reports, dt: float, rng: np.random.Generator) -> tuple[object, None, None]:
        self.seen.append((reports, dt, rng.random()))
        return state, None, None


def spied(*names: str, **changes: Any) -> tuple[Fusion, Memory, dict[str, Any]]:
    """A centre with a spy for each of these trackers."""
    fusion = centre("imm-ukf", **changes)
    spies: dict[str, Any] = {name: Spy() for name in names}
    fusion.bank.trackers = spies
    return fusion, started(fusion), spies


def test_trackers_get_the_reports_by_id_in_any_process() -> None:
    """However they came, and however this process hashes its strings: here twenty in a random order."""
    ids = [f"n{i:02}" for i in range(20)]
    fusion, memory, spies = spied(
        "spy", sensors=[(id, float(i), -float(i)) for i, id in enumerate(ids)], step_ns=NS // 2
    )
    reports = [Received(NS // 2 + i, Doa(1, 10.0 * i, 50.0 + i), id) for i, id in enumerate(ids)]
    play(fusion, memory, [*Random(1).sample(reports, len(reports)), Timer(NS, "deadline")])
    ((seen, dt, _),) = spies["spy"].seen
    assert (seen.step, seen.sensors, dt) == (1, tuple(ids), 0.5)
    assert seen.positions.tolist() == [[float(i), -float(i)] for i in range(20)]
    assert seen.bearings == pytest.approx(np.radians(10.0 * np.arange(20)))
    assert seen.levels.tolist() == [50.0 + i for i in range(20)]


def test_each_tracker_draws_anew_for_itself_in_each_step_and_always_the_same() -> None:
    lives = []
    for _ in range(2):
        fusion, memory, spies = spied("a", "b")
        play(fusion, memory, [deadline(step) for step in (1, 2, 3)])
        lives.append([draw for spy in spies.values() for _, _, draw in spy.seen])
    assert lives[0] == lives[1]
    assert len(set(lives[0])) == 6


# --- what only a broken driver does -------------------------------------------------------------------------------


def test_it_starts_once_and_before_anything_else() -> None:
    fusion = centre()
    for event in (report(1, "n0"), deadline(1)):
        with pytest.raises(IllegalEvent):
            fusion.handle(fusion.begin(), event)
    memory = started(fusion)
    for phase_events in ([], [deadline(1)], [*(report(1, id) for id, _, _ in SENSORS), deadline(1)]):
        reached, _ = play(fusion, memory, phase_events)
        with pytest.raises(IllegalEvent, match="Started"):
            fusion.handle(reached, Started(0))


@pytest.mark.parametrize("event", [PortRead(5, "tty", b""), Sampled(5, "sound", None)])
def test_it_has_neither_ports_nor_sensors(event: Event) -> None:
    fusion = centre()
    for memory in (fusion.begin(), started(fusion)):
        with pytest.raises(IllegalEvent, match="cannot handle"):
            fusion.handle(memory, event)


# --- whatever happens ---------------------------------------------------------------------------------------------


def picture(value: Any) -> Any:
    """All that is in a value, down to the bytes of its arrays, as plain tuples that share nothing with it."""
    if isinstance(value, np.ndarray):
        return value.shape, value.dtype.str, value.tobytes()
    if is_dataclass(value):
        return type(value).__name__, tuple(picture(getattr(value, field.name)) for field in fields(value))
    if isinstance(value, Mapping):
        return tuple(sorted((key, picture(item)) for key, item in value.items()))
    if isinstance(value, tuple | list):
        return tuple(picture(item) for item in value)
    return value


def test_a_picture_shows_every_change() -> None:
    """The check below is worth what this is: a single number changed anywhere in a state must show."""
    fusion = centre("spcpf", "imm-ukf", prior=PRIOR)
    memory, _ = play(fusion, started(fusion), [report(1, "n0"), deadline(1), report(2, "n0")])
    arrays = [leaf for leaf in leaves(memory) if isinstance(leaf, np.ndarray) and leaf.flags.writeable]
    assert len(arrays) >= 3
    for array in arrays:
        before, first = picture(memory), array.flat[0]
        array.flat[0] = first + 1
        assert picture(memory) != before
        array.flat[0] = first
        assert picture(memory) == before


def leaves(value: Any) -> list[Any]:
    if is_dataclass(value):
        value = [getattr(value, field.name) for field in fields(value)]
    elif isinstance(value, Mapping):
        value = list(value.values())
    if not isinstance(value, tuple | list):
        return [value]
    return [leaf for item in value for leaf in leaves(item)]


happenings = st.lists(
    st.one_of(
        st.just("deadline"),
        st.tuples(st.integers(-3, 2), st.sampled_from(["n0", "n1", "n2", "n3", "stranger"]), st.floats(20, 80)),
        st.just("request"),
    ),
    max_size=25,
)


@settings(max_examples=60)
@given(happenings, st.booleans(), st.integers(0, 3))
def test_any_events_in_any_order(happened: list[Any], with_prior: bool, max_age: int) -> None:
    """Equal calls have equal answers, no call writes into the state that it was given, and the table is kept."""
    fusion = centre("imm-ukf", "spcpf", prior=PRIOR if with_prior else None, max_age_ns=max_age * NS)
    memory = started(fusion)
    for what in happened:
        step = memory.progress.step + 1
        match what:
            case (ahead, sensor, x):
                event: Event = report(max(step + ahead, 0), sensor, x=x, delay_ns=-ahead * NS)
            case "request":
                event = Received(step * NS, Request(1), "n0")
            case _:
                event = deadline(step)
        before = picture(memory)
        after, effects = fusion.handle(memory, event)
        again, repeated = fusion.handle(memory, event)
        assert picture(memory) == before
        assert picture(again) == picture(after)
        assert repeated == effects
        assert after.phase in TRANSITIONS[memory.phase, type(event)]
        assert [e.name for e in effects if isinstance(e, State)] == (
            [after.phase.value] if after.phase is not memory.phase else []
        )
        assert all(np.isfinite(p.mean).all() and np.isfinite(p.covariance).all() for p in points(effects))
        memory = after
