"""Protocols whose peers answer each other within milliseconds: as processes they come to what virtual time comes to."""

from __future__ import annotations

import subprocess
import sys
import time
from collections import Counter
from dataclasses import replace
from functools import cache
from typing import Any

import psutil
import pytest

from launcher.record.ledger import Ledger
from launcher.records import MessageRow, Plan
from tests.protocols import study
from tests.protocols.agreement import Compared, Stalls, in_time
from tests.protocols.hardships import DEEDS, hard
from tests.protocols.parties import KINDS, PARTIES
from tests.protocols.study import Tally
from tests.running import until
from tests.simulated import simulated
from tests.test_drivers_agree import toy_plan
from trackfield.drivers.engine.frames import Died
from trackfield.drivers.spec import role_of
from trackfield.role import NS, Received
from trackfield.wire.codec import decode

SEEDS = (1, 2)
SHORT_S = 5
"""Emulated seconds of runs at speed 1."""


@cache
def virtual(protocol: str, seed: int = 1) -> Ledger:
    return simulated(toy_plan(*PARTIES[protocol](seed)))[0]


def words(ledger: Ledger, kind: str) -> list[tuple[str, str, str, Any]]:
    """All (source, receiver, outcome, message) of a kind."""
    return [(r.src, r.dst, r.outcome, decode(r.payload)) for r in ledger.rows if r.kind == kind]


# --- what the protocols do --------------------------------------------------------------------------------------------


def test_an_election_has_rivals_and_ends_in_one_mind() -> None:
    """In most rounds two claim at least, as they have not heard of each other; all but a few end with the best."""
    claims = words(virtual("election"), "bid")
    rivals, best = Counter[int](), dict[int, int]()
    for round in range(1, 10):
        said = [(src, claim) for src, _, _, claim in claims if claim.round == round]
        rivals[round] = len({src for src, claim in said if not claim.hops})
        best[round] = max(claim.merit for _, claim in said)
        heard = {dst for _, dst, outcome, claim in claims if claim.merit == best[round] and outcome == "delivered"}
        assert len(heard) >= 11, round
    assert sum(count >= 2 for count in rivals.values()) >= 7, rivals
    assert all(count <= 9 for count in rivals.values()), "some held back in each round"


def test_a_relay_brings_nearly_all_to_the_sink_and_tells_repetitions_apart() -> None:
    ledger = virtual("relay")
    made = {item.number for src, _, _, item in words(ledger, "parcel") if src == "source"}
    came = {
        item.number for _, dst, outcome, item in words(ledger, "parcel") if dst == "sink" and outcome == "delivered"
    }
    assert len(made) > 100
    assert len(made - came) <= 3
    repeated = [outcome for *_, outcome, item in words(ledger, "parcel") if outcome == "ignored"]
    assert len(repeated) > 50


def test_a_token_goes_round_and_is_made_again_when_it_is_lost() -> None:
    tokens = words(virtual("ring"), "token")
    lost = sum(outcome == "radio" for *_, outcome, _ in tokens)
    generations = sorted({token.generation for *_, token in tokens})
    assert lost >= 5
    assert len(generations) >= lost
    assert len(tokens) > 250
    assert {src for src, *_ in tokens} == {f"m{i}" for i in range(8)}


def test_pairs_talk_at_once_and_by_radio() -> None:
    """Of the questions to both, only those to the peer are frames, and so are the answers."""
    ledger = virtual("hosted")
    asked, answered = words(ledger, "ask"), words(ledger, "answer")
    assert len(asked) > 200
    assert len(answered) == sum(outcome == "delivered" for *_, outcome, _ in asked)
    assert all(src != dst for src, dst, *_ in asked + answered)


def test_a_sleeper_hears_a_preamble_as_long_as_its_interval_and_seldom_a_short_one() -> None:
    calls = [(row, row.outcome) for row in virtual("dozing").rows if row.kind == "call" and row.outcome != "radio"]
    assert {"delivered", "asleep"} <= {outcome for _, outcome in calls}
    lost = Counter(r.outcome for r in virtual("dozing").rows)
    assert lost["asleep"] > 10
    assert lost["radio"] > 1
    assert len(words(virtual("dozing"), "news")) > 10


def test_a_field_talks_over_several_hops_and_is_answered() -> None:
    ledger = virtual("collection")
    hops = [(dst, outcome, hop) for _, dst, outcome, hop in words(ledger, "hop")]
    up = {(hop.origin, hop.number): hop.hops + 1 for dst, _, hop in hops if dst == "base" and not hop.to}
    made = {(hop.origin, hop.number) for _, _, hop in hops if not hop.to}
    back = {(hop.number, dst) for dst, outcome, hop in hops if hop.to == dst.encode() and outcome == "delivered"}
    assert len(made) > 150
    assert len(up) > 0.95 * len(made)
    assert max(up.values()) >= 3, "the field is several hops wide"
    assert len(back) > 0.95 * len(up)


def _way(row: MessageRow) -> tuple[str, bytes | None]:
    """What two messages have in common whose order matters: their kind, and in a tree where they go."""
    return row.kind, getattr(decode(row.payload), "to", None)


@pytest.mark.parametrize("protocol", PARTIES)
def test_the_order_of_two_messages_changes_all_that_follows(protocol: str) -> None:
    """What makes a run of these a test at all: a state after two frames is another one if they came the other way."""
    ledger = virtual(protocol)
    for process in PARTIES[protocol](1)[1]:
        role = role_of(process)
        got = [r for r in ledger.rows if r.dst == process.id and r.delivered and r.kind in KINDS[protocol]]
        first, second = got[0], next(r for r in got if r.payload != got[0].payload and _way(r) == _way(got[0]))
        states = []
        for pair in ((first, second), (second, first)):
            state = role.begin()
            for row in pair:
                state, _ = role.handle(state, Received(NS, decode(row.payload), row.src))
            states.append(state)
        assert states[0] != states[1]


@pytest.mark.parametrize("protocol", PARTIES)
def test_times_are_hard(protocol: str) -> None:
    """Over some seeds all that can befall a process does, and is felt."""
    lost, deaths, lives = Counter[str](), 0, 0
    for seed in range(1, 13):
        ledger = simulated(toy_plan(*hard(protocol, seed)))[0]
        lost.update(r.outcome for r in ledger.rows)
        deaths += sum(isinstance(t.effect, Died) for diary in ledger.diaries.values() for t in diary.told)
        lives += sum(diary.spec.incarnation > 0 and bool(diary.told) for diary in ledger.diaries.values())
    assert all(lost[cause] > 0 for cause in ("radio", "partition", "dead", "frozen")), lost
    assert protocol != "election" or lost["asleep"] > 0
    assert deaths > 2
    assert lives > 2


def test_all_deeds_befall_somebody() -> None:
    lives = [p for seed in range(1, 4) for p in hard("election", seed)[1]]
    assert any(p.freezes for p in lives)
    assert any(p.jumps for p in lives)
    assert any(p.incarnation for p in lives)
    assert any("battery_fj" in p.power for p in lives)
    assert any(p.kill_ns and not any(q.id == p.id and q.incarnation > p.incarnation for q in lives) for p in lives)
    assert len(DEEDS) == 5


# --- as processes -----------------------------------------------------------------------------------------------------


def shortened(plan: Plan) -> Plan:
    return replace(plan, run=replace(plan.run, end_ns=SHORT_S * NS))


def check(one: Compared) -> None:
    assert one.found == ()
    assert one.host_late == 0
    assert one.host_lost == 0


@pytest.mark.alone
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("protocol", PARTIES)
def test_peers_that_answer_each_other_are_the_same_under_both_drivers(protocol: str, seed: int) -> None:
    """Faster than the host's own latency, and as fast as the clock: equal to the last bit."""
    plan = toy_plan(*PARTIES[protocol](seed, seconds=SHORT_S))
    check(in_time(plan, 5.0, 2.0))
    check(in_time(plan, 1.0, 0.5))


@pytest.mark.alone
@pytest.mark.parametrize("protocol", PARTIES)
def test_hard_times_among_peers_are_the_same_under_both_drivers(protocol: str) -> None:
    check(in_time(toy_plan(*hard(protocol, 1)), 5.0, 2.0, 0.5))


# --- what the study says ----------------------------------------------------------------------------------------------


def outcome(*found: str, host_late: int = 0, retractions: int = 0) -> Compared:
    timing = {"host_late": host_late, "retractions": retractions, "lag_ms": {"max": None}}
    return Compared({"timing": timing, "frames": {"host_lost": 0}}, found)


def test_a_run_that_differs_has_to_say_that_the_machine_was_too_slow() -> None:
    assert study.wrong(outcome("tracks differ")) == ["tracks differ"]
    assert study.wrong(outcome("tracks differ", host_late=1)) == []
    assert study.wrong(outcome()) == []


def test_how_many_have_to_be_equal() -> None:
    runs = [outcome(retractions=1)] * 19 + [outcome("tracks differ", host_late=1)]
    assert list(Tally("relay", "disturbed", runs).complaints()) == []
    assert list(Tally("relay", "fast", runs).complaints()) == ["relay, fast: 19 of 20 runs are equal, 100% should be"]
    assert len(list(Tally("relay", "disturbed", [*runs, runs[-1]]).complaints())) == 1


def test_elections_have_to_take_frames_back() -> None:
    runs = [outcome(), outcome(retractions=3), outcome()]
    assert list(Tally("ring", "fast", runs).complaints()) == []
    assert list(Tally("election", "fast", runs).complaints()) == ["election, fast: retractions in 1 of 3 runs only"]
    assert list(Tally("election", "fast", runs[:2]).complaints()) == []


def test_a_failing_seed_is_told_as_the_command_that_repeats_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(study, "lived", lambda protocol, seed, way: outcome(*["tracks differ"] * (seed == 2)))
    said: list[str] = []
    assert study.study(["ring"], ["slow"], range(1, 4), said.append) == 1
    assert said[0] == "ring 2 fails: python -m tests.protocols.study --seeds 1 --seed 2 --only ring --ways slow"
    assert "| ring | slow | 3 | 2 | 0 | 0 | 0 | 0 | 0 |" in said
    assert study.study(["ring"], ["slow"], range(3, 6), said.append) == 0


def test_stalls_stop_processes_of_a_run_and_let_them_go_on() -> None:
    titled = "import setproctitle, time; setproctitle.setproctitle('trackfield member m0'); time.sleep(60)"
    with subprocess.Popen([sys.executable, "-c", titled]) as process:
        with Stalls({"m0"}, 1) as stalls:
            until(lambda: stalls.count > 1)
        assert psutil.Process(process.pid).status() != psutil.STATUS_STOPPED
        with Stalls({"m1"}, 1) as others:
            time.sleep(1)
        process.kill()
    assert others.count == 0
