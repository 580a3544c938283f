"""References of references: chains, rings and hard times of processes that only keep the time."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from tests.mortals import lived
from tests.puppet import MS
from tests.test_timesync import CONFIG, ROUNDS
from trackfield.drivers.engine.frames import Frame, Refused, Told, Undone
from trackfield.drivers.spec import ProcessSpec, RunSpec
from trackfield.drivers.virtual import Virtual
from trackfield.link.clock import Clock
from trackfield.protocols.timesync import Rounds, Timekeeping, TimeSync
from trackfield.role import NS, Corrected, Effect, Event, Note


class Keeper:
    """A role of the piece alone, which notes of each correction the delta that it came from."""

    def __init__(self, **rounds: Any) -> None:
        self.sync = TimeSync(Rounds(**rounds) if rounds else None)
        self.kinds = self.sync.kinds

    def begin(self) -> Timekeeping:
        return self.sync.begin()

    def handle(self, state: Timekeeping, event: Event) -> tuple[Timekeeping, tuple[Effect, ...]]:
        after, effects = self.sync.handle(state, event)
        if state.best and any(isinstance(effect, Corrected) for effect in effects):
            return after, (Note(str(state.best.delta_ns)), *effects)
        return after, effects


@dataclass(frozen=True)
class Set:
    """A clock was set at ``t_ns`` (true time): its error from then on if it does not drift, and the delta."""

    t_ns: int
    error_ns: int
    delta_ns: int


class Watch:
    """A sink that keeps what processes with these clocks told."""

    def __init__(self, clocks: Mapping[str, Clock]) -> None:
        self.clocks = clocks
        self.sets, self.refused = defaultdict[str, list[Set]](list), defaultdict[str, list[tuple[int, str]]](list)
        self._delta = 0

    def sent(self, frame: Frame) -> None:
        """Every frame counts by what comes of it."""

    def told(self, process: str, output: Told | Refused | Undone) -> None:
        id, t = process.split("~", maxsplit=1)[0], output.key[0] if not isinstance(output, Undone) else 0
        match output:
            case Told(_, Note(text)):
                self._delta = int(text)
            case Told(_, Corrected(correction)):
                self.sets[id].append(Set(t, self.clocks[id].local(t) + correction - t, self._delta))
            case Refused(_, reason):
                self.refused[id].append((t, reason))

    def final(self, process: str, record: Mapping[str, Any]) -> None:
        """Counters are not needed."""


IDEAL: dict[str, Any] = {"model": "ideal"}


def keeper(id: str, reference: str | None, *, every_s: int = 5, seed: int = 1, **fields: Any) -> ProcessSpec:
    """One that asks its reference every so many seconds, or nobody."""
    asks = {**CONFIG, "resync_ns": every_s * NS, "reference": reference, "id": id, "seed": seed} if reference else {}
    return ProcessSpec(id, "keeper", f"{__name__}:Keeper", asks, **fields)


def watched(processes: list[ProcessSpec], *, link: dict[str, Any], seconds: int, seed: int = 1) -> Watch:
    clocks = {p.id: Clock(**p.clock) for p in processes}
    watch = Watch(clocks)
    Virtual(RunSpec("keepers", seed, seconds * NS, link), processes, watch).run()
    return watch


def test_the_error_grows_with_the_stratum_within_the_sum_of_half_the_delays() -> None:
    """Root, a, b, c, each the reference of the next, on a link that loses a sixth of the frames and delays by chance.

    Errors of strata are independent and alike, so in n of them the root mean square is sqrt(n) times that of one.
    """
    link = {
        "model": "gilbert_elliott", "loss_good": 0.1, "loss_bad": 0.5, "good_s": 5.0, "bad_s": 1.0,
        "delay_ms": 4.0, "jitter_ms": 10.0,
    }  # fmt: skip
    chain, errors = "abc", defaultdict[str, list[float]](list)
    for seed in range(1, 21):
        clocks = {id: {"offset_ns": i * 40 * MS} for i, id in enumerate(chain, 1)}
        asks = [keeper(id, to, seed=seed, clock=clocks[id]) for to, id in pairwise("r" + chain)]
        watch = watched([keeper("r", None), *asks], link=link, seconds=400, seed=seed)
        bounds: dict[str, list[tuple[int, float]]] = {"r": [(0, 0.0)]}
        for to, id in pairwise("r" + chain):
            bounds[id] = []
            for one in watch.sets[id]:
                began = one.t_ns - ROUNDS.lead_ns
                earlier = [bound for t, bound in bounds[to] if t <= began][-1:]
                reference = max([*earlier, *(bound for t, bound in bounds[to] if began < t <= one.t_ns)])
                bounds[id].append((one.t_ns, reference + one.delta_ns / 2 + 1001))
                assert abs(one.error_ns) <= bounds[id][-1][1]
            errors[id] += [one.error_ns / MS for one in watch.sets[id]]
    assert min(map(len, errors.values())) > 900
    rms = {id: float(np.sqrt(np.mean(np.square(errors[id])))) for id in chain}
    print("rms error by stratum, ms:", rms)
    assert rms["b"] / rms["a"] == pytest.approx(2**0.5, rel=0.1)
    assert rms["c"] / rms["a"] == pytest.approx(3**0.5, rel=0.1)


def test_processes_that_ask_each_other_never_set_their_clocks() -> None:
    def ring(*, broken: bool) -> Watch:
        """A ring of three; broken: one of them asks nobody."""
        a = keeper("a", None if broken else "c")
        return watched([a, keeper("b", "a"), keeper("c", "b")], link=IDEAL, seconds=100)

    assert not ring(broken=False).sets
    assert {reason for told in ring(broken=False).refused.values() for _, reason in told} == {"not synchronised"}
    assert ring(broken=True).sets.keys() == {"b", "c"}


def test_a_reference_that_dies_and_comes_back_tells_the_time_again_once_it_knows_it() -> None:
    """a is dead from 30 s to 60 s; b keeps its correction meanwhile, and asks in vain."""
    wrong = {"offset_ns": 70 * MS}
    a = lived(keeper("a", "r", seed=2, clock=wrong), (0, 30 * NS), (60 * NS, None))
    b = keeper("b", "a", every_s=1, seed=2, clock=wrong)
    watch = watched([keeper("r", None), *a, b], link=IDEAL, seconds=100)
    told = {id: [one.t_ns / NS for one in sets] for id, sets in watch.sets.items()}
    back = next(t for t in told["a"] if t > 60)
    assert max(t for t in told["b"] if t < 60) < 31
    assert back < min(t for t in told["b"] if t > 60) < back + 4 * ROUNDS.lead_ns / NS
    assert {reason for _, reason in watch.refused["a"]} == {"not synchronised"}
    assert [t for t, _ in watch.refused["a"] if 60 * NS < t < back * NS]
    assert {abs(one.error_ns) <= 2000 for sets in watch.sets.values() for one in sets} == {True}


def test_a_reference_whose_clock_jumps_misleads_others_until_it_sets_it_again() -> None:
    """The clock of a jumps by 0.5 s, 30 s after the start; a sets it at most a round and 5 s later."""
    a = keeper("a", "r", jumps=((30 * NS, 500 * MS),))
    watch = watched([keeper("r", None), a, keeper("b", "a", every_s=1)], link=IDEAL, seconds=60)
    right = next(one.t_ns for one in watch.sets["a"] if one.t_ns > 30 * NS)
    assert right < 36 * NS
    wrong = [one.t_ns for one in watch.sets["b"] if abs(one.error_ns) > 2000]
    assert wrong
    assert 30 * NS < min(wrong) <= max(wrong) < right + NS + ROUNDS.lead_ns
    assert max(one.error_ns for one in watch.sets["b"]) == pytest.approx(500 * MS, abs=2000)
