"""Who led when, how terms began, which slaves had which masters, how old what the base knew was: exact small cases."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from launcher.record.figures import terms
from launcher.record.figures.clusters import clusters_metrics
from launcher.record.figures.leaders import age_metrics, leaders_metrics, reports_asked
from launcher.record.ledger import Ledger
from launcher.record.tables import TrackRow
from launcher.records import SENSES, TRACKS, MessageRow, Place, Plan, View
from tests.led_runs import plan as clustered
from tests.simulated import simulated
from tests.tiny import MS, point, tiny
from trackfield.drivers.engine.frames import Died, Frame, Told
from trackfield.drivers.spec import ProcessSpec
from trackfield.protocols.association.joining import NO_PLACE
from trackfield.role import NS, Note, State
from trackfield.wire.clusters import Admit, HandOver, HandOverAck, Merge, Share, Wake
from trackfield.wire.codec import encode, kind_name

MASTERS = ("a", "b", "c")
BEGINS = re.compile(r"(\w+) leads in term (\d+): (.*)")
"""What a master notes as it begins to lead, and why."""
WHYS = {"it": terms.START, "over": terms.HAND_OVER, "silent": terms.TAKE_OVER}
"""By the last word of that."""


def field(end_s: int = 10) -> Plan:
    """Masters a, b and c, slaves s0 to s3, and a base, with a step each second."""
    plan = tiny()
    places = (
        Place("base", "base", 0.0, 0.0, frozenset({TRACKS})),
        *(Place(id, "master", 0.0, 0.0, frozenset({TRACKS})) for id in MASTERS),
        *(Place(f"s{i}", "slave", 0.0, 0.0, frozenset({SENSES})) for i in range(4)),
    )
    info = replace(plan.info, places=places)
    views = View("in-network", MASTERS), View("base", ("base",))
    processes = tuple(ProcessSpec(place.id, place.role, "none") for place in places)
    run = replace(plan.run, end_ns=end_s * NS)
    return replace(plan, run=run, info=info, views=views, processes=processes)


def frame(t_ms: int, src: str, message: Any, dst: str = "x", **more: Any) -> MessageRow:
    kept = {"outcome": "delivered", "bytes": 1, **more}
    due_ns = (t_ms + 10) * MS
    return MessageRow(kind_name(message), src, dst, "field", t_ms * MS, due_ns, payload=encode(message), **kept)


def led(source: str, step: int, term: int, *, told_ms: int = 300, sensors: int = 2) -> TrackRow:
    row = point(step, (0.0, 0.0, 0.0, 0.0), told_ms=told_ms)
    ids = tuple(f"s{i}" for i in range(sensors))
    return replace(row, point=replace(row.point, source=source, term=term, sensors=ids))


def beacon(t_ms: int, src: str, number: int, step: int, places: int = 0, leader: str = "") -> MessageRow:
    return frame(t_ms, src, Wake(number, (leader or src).encode(), step, 1 if places else 0, 0, bytes(range(places))))


def counts(figures: dict[str, Any]) -> tuple[int, ...]:
    return tuple(figures[key] for key in ("handovers", "lost_handovers", "take_overs", "false_take_overs"))


def figures(frames: list[MessageRow], tracks: list[TrackRow]) -> dict[str, Any]:
    return leaders_metrics(field(), frames, tracks)


# --- terms ------------------------------------------------------------------------------------------------------------


def test_without_terms_there_is_nothing() -> None:
    plan = tiny()
    found = leaders_metrics(plan, [frame(100, "fusion", Wake(0, b"", 1, 0, 0, b""))], [point(1, (0, 0, 0, 0))])
    nulls = ("per_step_mean", "per_step_max", "reports_used", "reports_asked")
    assert {key: found.pop(key) for key in nulls} == dict.fromkeys(nulls)
    assert [found.pop(key) for key in ("election_s", "healed_s")] == [{"mean": None, "max": None}] * 2
    assert set(found.values()) == {0}


def test_a_hand_over_that_is_acknowledged_begins_a_term() -> None:
    """Also if the acknowledgement is lost on its way: the term began."""
    offer = frame(1310, "a", HandOver(2, 1, b"x"), "b")
    ack = frame(1330, "b", HandOverAck(2), "a", outcome="radio")
    tracks = [led("a", 1, 1), led("b", 2, 2, sensors=4)]
    found = figures([offer, ack], tracks)
    assert counts(found) == (1, 0, 0, 0)
    assert (found["per_step_mean"], found["per_step_max"], found["two_leader_steps"]) == (1.0, 1, 0)
    assert (found["reports_used"], found["reports_asked"]) == (3.0, None)
    turns = terms.turns(terms.seen([offer, ack], [terms.Point("a", 0, 1, 1300 * MS)]))
    assert turns == [terms.Turn(1, "a", 1300 * MS, terms.START), terms.Turn(2, "b", 1330 * MS, terms.HAND_OVER)]


def test_a_hand_over_whose_term_never_began_is_lost() -> None:
    """The first nominee, b, does not answer; the second, c, leads in a term of its own."""
    frames = [
        frame(1310, "a", HandOver(2, 1, b"x"), "b", outcome="radio"),
        frame(1360, "a", HandOver(3, 1, b"x"), "c"),
        frame(1380, "c", HandOverAck(3), "a"),
    ]
    assert counts(figures(frames, [led("a", 1, 1), led("c", 2, 3)])) == (1, 1, 0, 0)
    lost = terms.lost_hand_overs(terms.seen(frames, []))
    assert lost == [terms.Lost(1310 * MS, 2, "a", "b")]


def test_a_take_over_of_a_dead_leader_is_none_of_a_living_one() -> None:
    tracks = [led("a", 1, 1), led("b", 5, 2)]
    assert counts(figures([], tracks)) == (0, 0, 1, 0)
    assert counts(figures([], [*tracks, led("a", 6, 1)])) == (0, 0, 1, 1)
    yields = beacon(5900, "a", 2, 6, leader="b")
    assert counts(figures([yields], tracks)) == (0, 0, 1, 1), "it says itself that it follows"
    again = replace(yields, incarnation=1)
    assert counts(figures([again], tracks)) == (0, 0, 1, 0), "in its next life it had not led"


def test_a_term_after_one_that_is_over_just_starts() -> None:
    tracks = [led("a", 1, 1), led("b", 5, 2)]
    over = frame(2310, "a", Share(1, 2, b"", b""))
    assert counts(figures([over], tracks)) == (0, 0, 0, 0)
    assert counts(figures([replace(over, sent_ns=5400 * MS)], tracks)) == (0, 0, 1, 1), "b had begun by then"


def test_a_leader_that_is_heard_before_its_first_point_leads_from_then_on() -> None:
    told = frame(4700, "b", Share(2, 3, b"", b"x"))
    [first, second] = terms.turns(terms.seen([told], [terms.Point("a", 0, 1, 1300 * MS)]))
    assert (first.how, second) == (terms.START, terms.Turn(2, "b", 4700 * MS, terms.TAKE_OVER))


def test_steps_with_two_leaders_are_counted_by_their_points() -> None:
    tracks = [led("a", 1, 1), led("a", 2, 1), led("b", 2, 2, sensors=5), led("b", 3, 2)]
    found = figures([], [*tracks, replace(tracks[-1], point=replace(tracks[-1].point, source="c", lag=2))])
    assert (found["per_step_mean"], found["per_step_max"], found["two_leader_steps"]) == (pytest.approx(4 / 3), 2, 1)
    assert found["reports_used"] == 3.0, "of step 2 that of the higher term counts"


def test_what_the_base_publishes_is_no_term_of_its_own() -> None:
    told = led("base", 2, 1)
    found = figures([], [led("a", 1, 1), replace(told, point=replace(told.point, origin="a"))])
    assert (counts(found), found["per_step_max"]) == ((0, 0, 0, 0), 1)


FAULTS = (
    "faults=[{kind='partition', nodes=['m3', 'm4', 'm5'], at_s=10, until_s=24}, {kind='kill', nodes=['m2'], at_s=54}]"
)


def test_terms_began_as_their_leaders_say(tmp_path: Path) -> None:
    """What is told by frames and points is what the masters noted themselves."""
    plan = clustered(tmp_path, FAULTS)
    ledger, tracks = simulated(plan)
    noted = set[tuple[int, str, str]]()
    for diary in ledger.diaries.values():
        for told in diary.told:
            if isinstance(told.effect, Note) and (found := BEGINS.fullmatch(told.effect.text)):
                leader, number, why = found.groups()
                noted.add((int(number), leader, WHYS[why.split()[-1]]))
    seen = terms.seen(
        ledger.rows,
        [
            terms.Point(row.point.source, row.incarnation, row.point.term, row.told_ns)
            for row in tracks
            if not row.point.origin
        ],
    )
    turns = terms.turns(seen)
    assert {(turn.number, turn.leader, turn.how) for turn in turns} == noted
    assert {how for *_, how in noted} == set(WHYS.values())
    assert {turn.false for turn in turns if turn.how == terms.TAKE_OVER} == {True, False}


# --- reports ----------------------------------------------------------------------------------------------------------


def test_a_leader_asked_its_own_slaves_by_its_beacon_and_others_by_their_masters() -> None:
    frames = [
        beacon(900, "a", 1, 1, places=3),
        beacon(900, "a", 1, 1, places=3),  # at another hearer
        beacon(1900, "a", 1, 2, places=3),
        beacon(2900, "a", 1, 3),
        frame(950, "a", Merge(1, 1, 2, 3, bytes(4)), "b"),  # two slaves of b, for steps 1 and 2
        frame(1400, "a", Merge(1, 2, 2, 3, bytes(6)), "c"),  # three of c, for steps 2 and 3
        frame(2400, "a", Merge(1, 3, 0, 0, b""), "c"),  # no more
        beacon(1900, "b", 1, 2, places=2, leader="a"),
    ]
    assert reports_asked(frames, {1: "a", 2: "a", 3: "a", 4: "a"}, 0, NS) == {1: 3 + 2, 2: 3 + 2 + 3, 3: 0}


# --- slaves -----------------------------------------------------------------------------------------------------------


def slaves(*states: tuple[int, str, str], admits: list[tuple[int, str, int, int]], dead: str = "") -> dict[str, Any]:
    """States (ms, slave, state) and answers (ms, master, sensor, place), broadcast to s0 and s1."""
    plan = field()
    plan = replace(plan, info=replace(plan.info, origin_ns=2 * NS))
    book = Ledger(plan.run, plan.processes)
    for t_ms, id, state in states:
        book.told(id, Told((t_ms * MS, 3, t_ms * MS, "t"), State(state)))
    if dead:
        book.told(dead, Told((8 * NS, 3), Died("battery")))
    for t_ms, master, sensor, place in admits:
        for hearer in ("s0", "s1"):
            admit = Frame(master, 0, "admit", t_ms * MS, 0, hearer, "field", encode(Admit(sensor, place, 0)))
            book.sent(admit)
    book.close()
    return clusters_metrics(plan, book)


def test_where_there_are_no_slaves_there_is_nothing() -> None:
    plan = tiny()
    found = clusters_metrics(plan, Ledger(plan.run, plan.processes))
    assert found == {"members": {}, "orphans_first": None, "orphans_last": None, "overheard": 0}


def test_a_slave_belongs_to_the_master_that_answered_it_last() -> None:
    states = [(500, "s0", "asleep"), (500, "s1", "seeking"), (3000, "s1", "asleep"), (500, "s2", "orphan")]
    found = slaves(*states, admits=[(400, "a", 0, 2), (2900, "c", 1, NO_PLACE), (2950, "b", 1, 0), (6000, "b", 0, 1)])
    assert found == {
        "members": {"a": [], "b": ["s0", "s1"], "c": []},
        "orphans_first": 3,  # s1 seeks, s2 is an orphan, s3 says nothing
        "orphans_last": 2,
        "overheard": 4,
    }


def test_a_slave_without_a_master_or_without_life_is_no_member() -> None:
    states = [(500, id, "asleep") for id in ("s0", "s1", "s2", "s3")]
    found = slaves(*states, (5000, "s0", "orphan"), admits=[(400, "a", 0, 2), (450, "a", 1, 3)], dead="s1")
    assert (found["members"]["a"], found["orphans_first"], found["orphans_last"]) == ([], 0, 1)


# --- the base ---------------------------------------------------------------------------------------------------------


def test_the_age_of_what_the_base_knew() -> None:
    rows = [led("base", step, 1) for step in range(1, 6)]
    told = [replace(row, point=replace(row.point, known_step=1)) for row in rows]
    assert age_metrics(field(), told) == {"mean": 2.0, "p95": pytest.approx(3.8)}
    other = replace(told[0], point=replace(told[0].point, tracker="other", known_step=0))
    assert age_metrics(field(), [*rows, other]) == {"mean": None, "p95": None}
