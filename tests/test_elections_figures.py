"""Elections in metrics.json: exact small cases of claims, who led after them, how long that took and lasted."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from head.peers.choice import OUT_OF_REACH
from launcher.record.figures import terms
from launcher.record.figures.awake import awake_share
from launcher.record.figures.elections import Election, Led, elections
from launcher.record.figures.energy import Battery
from launcher.record.figures.leaders import leaders_metrics, reports_asked
from launcher.record.ledger import Ledger
from launcher.record.metrics import cut_off, run_metrics
from launcher.records import BATTERY, PEER, SENSES, TRACKS, MessageRow, Place, Plan, View
from tests.tiny import MS, point, tiny
from trackfield.drivers.engine.frames import Died, Told
from trackfield.drivers.engine.meter import Activity
from trackfield.drivers.spec import ProcessSpec
from trackfield.link.energy import DEVICES
from trackfield.link.fate import FIELD
from trackfield.role import NS, Listen, Note, Radio
from trackfield.wire.clusters import HandOverAck
from trackfield.wire.codec import encode, kind_name
from trackfield.wire.peers import Claim, Dissolve, HeadEstimate, JoinClaim, Poll, Result

IDS = ("a", "b", "c")
EXPIRES = 10


def field() -> Plan:
    """Nodes a, b and c of which any may lead, and a base, with a step each second."""
    plan = tiny()
    tags = frozenset({TRACKS, SENSES, BATTERY})
    places = (Place("base", "base", 0.0, 0.0, frozenset({TRACKS})), *(Place(id, PEER, 0.0, 0.0, tags) for id in IDS))
    info = replace(plan.info, places=places)
    processes = tuple(ProcessSpec(place.id, place.role, "none") for place in places)
    views = View("in-network", IDS), View("base", ("base",))
    return replace(plan, run=replace(plan.run, end_ns=60 * NS), info=info, views=views, processes=processes)


def frame(t_ms: int, src: str, message: Any, dst: str = "x", outcome: str = "delivered") -> MessageRow:
    sent_ns = t_ms * MS
    return MessageRow(kind_name(message), src, dst, "field", sent_ns, sent_ns, outcome, 1, payload=encode(message))


def claim(t_ms: int, src: str, key: int, number: int = 1) -> MessageRow:
    return frame(t_ms, src, Claim(number, key, EXPIRES))


def poll(t_ms: int, src: str, number: int = 1, sensors: int = 3) -> MessageRow:
    return frame(t_ms, src, Poll(number, t_ms // 1000 + 1, bytes(2 * sensors)))


def found(*frames: MessageRow, points: tuple[terms.Point, ...] = ()) -> list[Election]:
    return elections(terms.seen(frames, points), NS)


def figures(*frames: MessageRow, by: str = "a") -> dict[str, Any]:
    row = point(1, (0.0, 0.0, 0.0, 0.0))
    tracks = [replace(row, point=replace(row.point, source=by, term=1))]
    return leaders_metrics(field(), frames, tracks)


# --- one election -----------------------------------------------------------------------------------------------------


def test_claims_of_one_number_are_one_election_and_last_until_one_of_them_polls() -> None:
    frames = claim(1000, "a", 300), claim(1020, "b", 200), poll(1900, "b"), poll(2900, "b")
    assert found(*frames) == [
        Election(1, 1000 * MS, (("a", 300), ("b", 200)), (Led("b", 1900 * MS, 2900 * MS),)),
    ]
    [one] = found(*frames)
    assert (one.took_ns, one.split, one.healed_ns) == (900 * MS, False, None)


def test_a_claim_that_several_hear_or_that_is_repeated_is_one() -> None:
    twice = claim(1000, "a", 300), replace(claim(1000, "a", 300), dst="y"), claim(1100, "a", 300)
    assert [one.claims for one in found(*twice)] == [(("a", 300),)]


def test_a_relay_is_no_claim() -> None:
    relay = frame(1010, "b", JoinClaim(1, 300, b"a", 65535, EXPIRES))
    assert [one.claims for one in found(claim(1000, "a", 300), relay)] == [(("a", 300),)]


WORDS = Result(1, 2, 0, 0, 0, 0, 1, 1), HeadEstimate(1, 2, b"x")


@pytest.mark.parametrize("word", WORDS)
def test_what_a_head_says_later_counts_as_leading(word: Any) -> None:
    [one] = found(claim(1000, "a", 300), poll(1500, "a"), frame(2300, "a", word))
    assert one.led == (Led("a", 1500 * MS, 2300 * MS),)


@pytest.mark.parametrize("word", WORDS)
def test_one_that_speaks_before_it_polls_takes_over(word: Any) -> None:
    """Its claim was void, as a head was known; it has the same number as the term in which it follows that head."""
    frames = [poll(900, "b", number=0), claim(1000, "a", 300), frame(6500, "a", word), poll(6900, "a")]
    assert [one.led for one in found(*frames)] == [()]
    assert terms.turns(terms.seen(frames, []))[-1].how == terms.TAKE_OVER


def test_who_publishes_in_the_term_leads_in_it() -> None:
    [one] = found(claim(1000, "a", 300), points=(terms.Point("a", 0, 1, 1300 * MS),))
    assert one.took_ns == 300 * MS


def test_who_did_not_claim_or_was_handed_the_term_is_no_winner() -> None:
    """Node b has the number by a hand-over of another head, a by its claim; c only polls."""
    ack = frame(1400, "b", HandOverAck(1))
    [one] = found(claim(1000, "a", 300), claim(1010, "b", 400), ack, poll(1900, "a"), poll(1900, "b"), poll(1900, "c"))
    assert [led.leader for led in one.led] == ["a"]


def test_nobody_may_win() -> None:
    [one] = found(claim(1000, "a", 300), poll(1900, "b"))
    assert (one.led, one.took_ns, one.healed_ns) == ((), None, None)


def test_the_same_number_some_time_later_is_another_election() -> None:
    """The second one, of nodes that heard nothing of the first: the leader of that is none of its own."""
    early = claim(1000, "a", 300), claim(2500, "c", 300), poll(3900, "a")
    assert len(found(*early, claim(5500, "b", 200))) == 1
    first, second = found(*early, claim(5501, "b", 200), poll(5900, "b"), poll(6900, "a"))
    assert [(one.begun_ns, [led.leader for led in one.led]) for one in (first, second)] == [
        (1000 * MS, ["a"]),
        (5501 * MS, ["b"]),
    ]


def test_of_long_steps_three_are_waited_for() -> None:
    seen = terms.seen([claim(1000, "a", 300), claim(7000, "b", 200)], [])
    assert [len(elections(seen, step_ns)) for step_ns in (NS, 2 * NS)] == [2, 1]


def test_a_late_claim_of_the_same_node_is_for_its_own_election() -> None:
    """Node a claimed the number twice, a long time apart, and led only after the second claim."""
    first, second = found(claim(1000, "a", 300), claim(20_000, "a", 250), poll(20_900, "a"))
    assert (first.led, second.took_ns) == ((), 900 * MS)


# --- split elections --------------------------------------------------------------------------------------------------


def test_a_split_election_heals_when_all_but_one_are_silent() -> None:
    polls = [poll(1900, "a"), poll(2900, "a"), poll(1950, "b"), poll(2950, "b"), poll(3950, "b"), poll(2800, "c")]
    claims = [claim(1000, "a", 300), claim(1010, "b", 400), claim(1020, "c", 500)]
    [one] = found(*claims, *polls)
    assert [led.leader for led in one.led] == ["a", "b", "c"]
    assert (one.split, one.healed_ns) == (True, (2900 - 1950) * MS)


def test_leaders_one_after_the_other_overlap_for_no_time() -> None:
    [one] = found(claim(1000, "a", 300), claim(1010, "b", 400), poll(1900, "a"), poll(3900, "b"))
    assert (one.split, one.healed_ns) == (True, 0)


# --- metrics.json -----------------------------------------------------------------------------------------------------


def test_the_figures_of_elections() -> None:
    split = [
        claim(1000, "a", 300),
        claim(1010, "b", 400),
        poll(1900, "a"),
        poll(1950, "b"),
        poll(2500, "b"),
        poll(2900, "a"),
    ]
    won = [claim(20_000, "c", 100, number=2), poll(20_500, "c", number=2)]
    lost = [claim(40_000, "b", 100, number=3)]
    # the point of node a, in term 1, was told at 1.3 s
    counted = figures(*split, *won, *lost)
    assert [counted[key] for key in ("elections", "split_elections", "unwon_elections")] == [3, 1, 1]
    assert counted["election_s"] == {"mean": pytest.approx((0.3 + 0.5) / 2), "max": pytest.approx(0.5)}
    assert counted["healed_s"] == {"mean": pytest.approx(0.55), "max": pytest.approx(0.55)}


def test_a_term_of_a_claimer_began_by_an_election_and_not_by_a_take_over() -> None:
    frames = [poll(1900, "a"), claim(5000, "b", 300, number=2), poll(5900, "b", number=2), poll(7900, "c", number=3)]
    assert [(turn.leader, turn.how, turn.false) for turn in terms.turns(terms.seen(frames, []))] == [
        ("a", terms.START, False),
        ("b", terms.ELECTION, False),
        ("c", terms.TAKE_OVER, False),
    ]
    again = terms.turns(terms.seen([*frames, poll(6900, "a")], []))
    assert (again[1].how, again[1].false) == (terms.ELECTION, True), "a was only not heard"
    counted = figures(*frames)
    assert (counted["take_overs"], counted["elections"], counted["handovers"]) == (1, 1, 0)


def test_a_dissolved_term_is_over() -> None:
    gone = frame(4300, "a", Dissolve(1, 4, 1))
    counted = figures(poll(1900, "a"), gone, replace(gone, dst="y"), poll(7900, "b", number=2))
    assert (counted["dissolved"], counted["take_overs"]) == (1, 0)


def test_the_head_asked_those_in_its_poll() -> None:
    frames = [poll(1900, "a", sensors=3), poll(2900, "b", sensors=4), poll(2900, "a", sensors=1)]
    assert reports_asked(frames, {1: "a", 2: "a", 3: "b"}, 0, NS) == {2: 3, 3: 4}


def test_steps_with_better_sensors_out_of_reach_are_counted_once() -> None:
    plan = field()
    book = Ledger(plan.run, plan.processes)
    notes = [(4300, "a", f"{OUT_OF_REACH}n7, n8"), (4310, "b", f"{OUT_OF_REACH}n7"), (6300, "a", f"{OUT_OF_REACH}n9")]
    for t_ms, id, text in [*notes, (8300, "a", "handed over to b, term 3")]:
        book.told(id, Told((t_ms * MS, 3, t_ms * MS, "t"), Note(text)))
    book.close()
    assert leaders_metrics(plan, [], [], book.diaries.values())["out_of_reach_steps"] == 2


# --- receivers --------------------------------------------------------------------------------------------------------


def battery(id: str, *ns: int) -> Battery:
    return Battery(ProcessSpec(id, PEER, "none"), {FIELD: DEVICES["cc2420"]}, {FIELD: Activity(*ns)}, sum(ns), None)


def test_a_radio_is_awake_while_it_does_not_sleep() -> None:
    each = [battery("a", 10, 20, 20, 50), battery("b", 0, 0, 10, 90), battery("base", 0, 0, 100, 0)]
    assert awake_share(field(), [], each) == {"mean": pytest.approx((0.5 + 0.1) / 2), "most": 0.5}


def test_what_was_before_the_first_step_does_not_count() -> None:
    """The receiver is on for 4 of the first 5 s, and sleeps from then on but for 2 of the next 10 s."""
    plan = field()
    plan = replace(plan, info=replace(plan.info, origin_ns=5 * NS))
    book = Ledger(plan.run, plan.processes)
    for t_s, on in [(4, False), (7, True), (9, False)]:
        book.told("a", Told((t_s * NS, 3, t_s * NS, "t"), Radio(on)))
    book.close()
    one = battery("a", 0, 0, 6 * NS, 9 * NS)
    assert awake_share(plan, book.diaries.values(), [one])["mean"] == pytest.approx(0.2, abs=1e-6)


def test_windows_before_the_first_step_do_not_count_either() -> None:
    plan = field()
    plan = replace(plan, info=replace(plan.info, origin_ns=5 * NS))
    book = Ledger(plan.run, plan.processes)
    book.told("a", Told((NS, 3, NS, "t"), Listen(NS, NS // 10, NS)))
    book.close()
    one = battery("a", 0, 0, NS + 14 * NS // 10, 14 * NS * 9 // 10)  # until 15 s
    assert awake_share(plan, book.diaries.values(), [one])["mean"] == pytest.approx(0.1, abs=1e-6)


def test_a_life_that_ended_before_the_first_step_counts_for_nothing() -> None:
    plan = field()
    plan = replace(plan, info=replace(plan.info, origin_ns=5 * NS))
    book = Ledger(plan.run, plan.processes)
    book.told("a", Told((2 * NS, 3), Died("battery")))
    book.close()
    assert awake_share(plan, book.diaries.values(), [battery("a", 0, 0, 2 * NS, 0)]) == {"mean": None, "most": None}


def test_without_meters_there_is_no_share() -> None:
    assert awake_share(field(), [], []) == {"mean": None, "most": None}


def test_a_record_that_broke_off_does_not_know_the_share() -> None:
    """Meters tell what they counted at the end of the run."""
    plan = field()
    whole = run_metrics(plan, Ledger(plan.run, plan.processes), []) | {"awake_share": {"mean": 0.1, "most": 0.2}}
    assert cut_off(whole)["awake_share"] == {"mean": None, "most": None}
