"""Elections: who claims when, what is handed on, who wins; and what a lost frame of each kind leads to."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.elections import (
    HOLE,
    HOP_NS,
    JITTER_NS,
    MS,
    SETTLE_NS,
    Air,
    Ended,
    Field,
    Plain,
    elected,
)
from trackfield.protocols.election import (
    ANSWERS,
    CLAIM,
    MOST_FRAMES,
    OF_ONE,
    RELAY,
    SETTLE,
    TIMERS,
    WEAKEST,
    Bid,
    Election,
    Race,
)
from trackfield.protocols.lease import MOST_NUMBER
from trackfield.role import NEIGHBOURHOOD, CancelTimer, Effect, Ignored, IllegalEvent, Send, SetTimer
from trackfield.wire.codec import decode, encode
from trackfield.wire.peers import MOST_KEY, Claim, JoinClaim

NODE = Election("n5", 1, SETTLE_NS, HOP_NS, jitter_ns=JITTER_NS)
NOW = 1000 * MS
STEP = 7


def timer(effects: tuple[Effect, ...], name: str) -> int | None:
    """When this timer is set to by these effects; None if it is not, or is cancelled afterwards."""
    at = None
    for effect in effects:
        match effect:
            case SetTimer(set_, due) if set_ == name:
                at = due
            case CancelTimer(cancelled) if cancelled == name:
                at = None
    return at


def sent(effects: tuple[Effect, ...]) -> list[Any]:
    assert all(effect.to == NEIGHBOURHOOD for effect in effects if isinstance(effect, Send))
    return [effect.message for effect in effects if isinstance(effect, Send)]


def contending(key: int = 30000, number: int = 3) -> Race:
    return NODE.begin(Race(), NOW, number, key, STEP + 1)[0]


def claimed(key: int = 30000) -> Race:
    race, effects = NODE.ring(contending(key), NOW + 100 * MS, CLAIM)
    assert sent(effects) == [Claim(3, key, STEP + 1)]
    return race


def heard(race: Race, key: int, head: str, *, sender: str = "", number: int = 3, own: int = 40000) -> Any:
    """A claim of ``head``, or what ``sender`` relays of it."""
    if not sender:
        return NODE.hear(race, NOW, Claim(number, key, STEP), head, STEP)
    return NODE.hear(race, NOW, JoinClaim(number, key, head.encode(), own, STEP), sender, STEP)


def all_relays(race: Race) -> tuple[Race, list[Any]]:
    """What is sent if the timer of relays rings until none is due."""
    messages = []
    while race.due:
        race, effects = NODE.ring(race, NOW, RELAY)
        messages += sent(effects)
    return race, messages


# --- the back-off ---


@pytest.mark.parametrize("key", [0, 1000, 30000, WEAKEST])
def test_the_back_off_is_linear_in_the_key_with_a_jitter(key: int) -> None:
    race, effects = NODE.begin(Race(), NOW, 3, key, STEP)
    due = timer(effects, CLAIM)
    assert due is not None
    assert 0 <= due - NOW - 200 * MS * key // MOST_KEY < JITTER_NS
    assert (race.number, race.own, race.due_ns, race.open) == (3, key, due, True)
    assert timer(effects, SETTLE) == due + SETTLE_NS
    assert due + SETTLE_NS - NOW <= NODE.longest_ns


def test_the_jitter_is_drawn_by_seed_id_and_number() -> None:
    def jitter(node: Election, number: int) -> int | None:
        return timer(node.begin(Race(), NOW, number, 0, STEP)[1], CLAIM)

    others = replace(NODE, id="n6"), replace(NODE, seed=2)
    assert len({jitter(NODE, 3), jitter(NODE, 4), *(jitter(other, 3) for other in others)}) == 4
    assert jitter(NODE, 3) == jitter(NODE, 3)


def test_a_key_that_is_none_is_cut() -> None:
    """One that would mean that the node does not sense the target."""
    assert contending(MOST_KEY).own == WEAKEST
    assert contending(-1).own == 0


@pytest.mark.parametrize("number", [-1, 0, MOST_NUMBER + 1])
def test_a_number_that_is_none_begins_nothing(number: int) -> None:
    assert NODE.begin(Race(), NOW, number, 5, STEP) == (Race(), ())


def test_who_contends_already_does_not_begin_again() -> None:
    race = contending()
    assert NODE.begin(race, NOW, 3, 5, STEP) == (race, ())
    assert NODE.begin(race, NOW, 2, 5, STEP) == (race, ())
    assert NODE.begin(race, NOW, 4, 5, STEP)[0].number == 4


def test_an_election_that_is_over_is_not_begun_again() -> None:
    over, _ = NODE.ring(claimed(), NOW, SETTLE)
    assert over.outcome == "won"
    assert NODE.begin(over, NOW, 3, 5, STEP) == (over, ())
    assert NODE.begin(over, NOW, 4, 5, STEP)[0].open


# --- who wins ---


def test_alone_it_claims_and_wins() -> None:
    race = claimed()
    assert (race.best, race.claimed, race.waiting) == (Bid(30000, "n5"), True, False)
    over, _ = NODE.ring(race, NOW, SETTLE)
    assert over.outcome == "won"


def test_the_lower_key_wins_and_then_the_lower_id() -> None:
    assert Bid(5, "n9") < Bid(6, "n0")
    assert Bid(5, "n0") < Bid(5, "n9")
    for key, id, outcome in (
        (29999, "n9", "joined"),
        (30000, "n4", "joined"),
        (30000, "n6", "won"),
        (30001, "a", "won"),
    ):
        race, _ = heard(claimed(), key, id)
        assert NODE.ring(race, NOW, SETTLE)[0].outcome == outcome


def test_who_hears_a_better_claim_does_not_claim() -> None:
    race, effects = heard(contending(), 29999, "n9")
    assert CancelTimer(CLAIM) in effects
    assert timer(effects, CLAIM) is None
    assert timer(effects, SETTLE) == NOW + SETTLE_NS
    assert NODE.ring(race, NOW, CLAIM) == (race, ())
    over, _ = NODE.ring(race, NOW, SETTLE)
    assert (over.outcome, over.best) == ("joined", Bid(29999, "n9"))


def test_who_hears_a_worse_claim_in_its_back_off_claims_at_once() -> None:
    """Its turn would have come before; it does not relay the worse one."""
    race, effects = heard(contending(), 30001, "n9")
    due = timer(effects, CLAIM)
    assert due is not None
    assert NOW <= due <= NOW + HOP_NS
    assert (race.due, race.best) == (0, None)
    late = replace(contending(), due_ns=NOW + 3)
    assert timer(heard(late, 30001, "n9")[1], CLAIM) == NOW + 3


def test_the_first_word_counts_for_the_end() -> None:
    _, effects = heard(claimed(), 29999, "n9")
    assert timer(effects, SETTLE) is None
    assert CancelTimer(SETTLE) not in effects


# --- relays ---


def test_a_better_bid_is_relayed_with_one_repeat() -> None:
    race, effects = heard(contending(), 29999, "n9")
    due = timer(effects, RELAY)
    assert due is not None
    assert NOW <= due < NOW + HOP_NS
    race, effects = NODE.ring(race, due, RELAY)
    assert sent(effects) == [JoinClaim(3, 29999, b"n9", 30000, STEP)]
    again = timer(effects, RELAY)
    assert again is not None
    assert due + HOP_NS // 2 <= again < due + HOP_NS
    race, effects = NODE.ring(race, again, RELAY)
    assert sent(effects) == [JoinClaim(3, 29999, b"n9", 30000, STEP)]
    assert timer(effects, RELAY) is None
    assert NODE.ring(race, again, RELAY) == (race, ())


def test_a_better_bid_replaces_the_one_that_is_relayed() -> None:
    race, _ = heard(contending(), 20000, "n9")
    race, _ = NODE.ring(race, NOW, RELAY)
    race, _ = heard(race, 10000, "n8", sender="n7")
    _, messages = all_relays(race)
    assert messages == [JoinClaim(3, 10000, b"n8", 30000, STEP)] * 2


def test_a_worse_bid_is_answered_by_the_best_twice() -> None:
    race, messages = all_relays(heard(contending(), 20000, "n9")[0])
    answers = []
    for _ in range(5):
        race, _ = heard(race, 25000, "n8")
        race, more = all_relays(race)
        answers.append(len(more))
    assert (len(messages), answers) == (2, [1, 1, 0, 0, 0])
    assert race.relayed == OF_ONE


def test_a_worse_bid_is_not_answered_while_a_relay_is_due() -> None:
    race, _ = heard(contending(), 20000, "n9")
    assert heard(race, 25000, "n8")[0].due == race.due == 2


def test_what_everybody_knows_is_not_answered() -> None:
    race, _ = all_relays(heard(contending(), 20000, "n9")[0])
    after, effects = heard(race, 20000, "n9", sender="n8")
    assert (after.due, effects) == (0, ())


def test_a_claim_is_repeated_and_more_often_without_support() -> None:
    repeat = JoinClaim(3, 30000, b"n5", 30000, STEP + 1)
    assert all_relays(claimed())[1] == [repeat] * 3
    race, effects = heard(claimed(), 30000, "n5", sender="n8")
    assert (race.supporters, effects) == ({"n8"}, ())
    assert all_relays(race)[1] == [repeat]


def test_who_won_answers_a_late_claim_and_does_not_yield() -> None:
    over, _ = NODE.ring(all_relays(heard(claimed(), 30000, "n5", sender="n8")[0])[0], NOW, SETTLE)
    after, _ = heard(over, 40000, "n9")
    assert all_relays(after)[1] == [JoinClaim(3, 30000, b"n5", 30000, STEP + 1)]
    after, effects = heard(over, 20000, "n9")
    assert (after.outcome, after.best, effects) == ("won", Bid(30000, "n5"), (Ignored("outdated"),))


# --- nodes that do not sense the target ---


def test_who_does_not_sense_relays_what_one_that_does_says() -> None:
    for race, _ in (heard(Race(), 20000, "n9"), heard(Race(), 20000, "n9", sender="n8")):
        after, messages = all_relays(race)
        assert messages == [JoinClaim(3, 20000, b"n9", MOST_KEY, STEP)] * 2
        assert NODE.ring(after, NOW, SETTLE)[0].outcome == "joined"


def test_what_another_relay_says_is_passed_on_only_as_a_correction_or_answer() -> None:
    """So an election ends one hop outside the nodes that sense the target."""
    race, effects = heard(Race(), 20000, "n9", sender="r1", own=MOST_KEY)
    assert (race.best, race.due, timer(effects, SETTLE)) == (Bid(20000, "n9"), 0, NOW + SETTLE_NS)
    assert heard(race, 30000, "n8")[0].due == 1
    assert heard(race, 10000, "n8", sender="r1", own=MOST_KEY)[0].due == 2
    assert heard(contending(), 20000, "n9", sender="r1", own=MOST_KEY)[0].due == 2


def test_a_relay_that_comes_to_sense_the_target_takes_part() -> None:
    race, _ = all_relays(heard(Race(), 20000, "n9")[0])
    joins, _ = NODE.begin(race, NOW, 3, 30000, STEP)
    assert all_relays(joins)[1] == [JoinClaim(3, 20000, b"n9", 30000, STEP)]
    claims, effects = NODE.begin(race, NOW, 3, 10000, STEP)
    due = timer(effects, CLAIM)
    assert due is not None
    assert due - NOW < JITTER_NS  # a worse bid is known
    assert heard(claims, 20000, "n9", sender="n7")[0].due == 0
    assert NODE.ring(claims, due, CLAIM)[0].best == Bid(10000, "n5")


# --- who is there ---


def test_who_senses_and_who_supports() -> None:
    race, _ = heard(claimed(), 30000, "n5", sender="n8", own=41000)
    race, _ = heard(race, 40000, "n9")
    race, _ = heard(race, 30000, "n5", sender="r0", own=MOST_KEY)
    assert race.sensing == {"n8": 41000, "n9": 40000}
    assert race.supporters == {"n8", "r0"}
    race, _ = heard(race, 20000, "n1", sender="n8", own=42000)
    assert (race.sensing["n8"], race.supporters) == (42000, {"r0"})


# --- what is not believed ---


def test_numbers() -> None:
    """A higher one supersedes, with whoever contends; a lower one is outdated."""
    race = contending()
    assert heard(race, 5, "n9", number=2) == (race, (Ignored("outdated"),))
    assert heard(Race(), 5, "n9", number=0) == (Race(), (Ignored("outdated"),))
    after, effects = heard(claimed(), 5, "n9", number=4)
    assert (after.number, after.best, after.claimed, after.own) == (4, Bid(5, "n9"), False, 30000)
    assert timer(effects, CLAIM) is None
    after, effects = heard(claimed(), 40000, "n9", number=4)
    assert (after.number, after.best, after.waiting) == (4, None, True)
    assert timer(effects, CLAIM) == after.due_ns
    over, _ = NODE.ring(claimed(), NOW, SETTLE)
    after, _ = heard(over, 40000, "n9", number=4)
    assert (after.number, after.own, after.best, after.outcome) == (4, None, Bid(40000, "n9"), "")
    assert heard(race, 5, "n9", number=MOST_NUMBER + 1) == (race, (Ignored("implausible"),))


def test_what_expired_is_void() -> None:
    race = contending()
    for message in (Claim(3, 5, STEP - 1), JoinClaim(3, 5, b"n9", 9, STEP - 1)):
        assert NODE.hear(race, NOW, message, "n9", STEP) == (race, (Ignored("void"),))
    assert NODE.hear(race, NOW, Claim(3, 5, STEP), "n9", STEP)[0].best == Bid(5, "n9")


@pytest.mark.parametrize("head", [b"", b"\xff", b"a/b", b"-x"])
def test_a_head_without_an_id(head: bytes) -> None:
    race = contending()
    assert NODE.hear(race, NOW, JoinClaim(3, 5, head, 9, STEP), "n9", STEP) == (race, (Ignored("malformed"),))


def test_what_it_did_not_claim() -> None:
    """Of a former life, or forged."""
    race = contending()
    assert heard(race, 5, "n5", sender="n9") == (race, (Ignored("implausible"),))
    assert heard(claimed(), 5, "n5", sender="n9", number=4)[0].number == 3
    assert heard(claimed(), 5, "n5", sender="n9")[0].best == Bid(30000, "n5")
    assert heard(race, 5, "n5") == (race, (Ignored("own"),))


def test_once_a_head_is_known_nothing_more_is_sent() -> None:
    for race in (contending(), claimed(), heard(contending(), 5, "n9")[0]):
        after, effects = NODE.stop(race)
        assert after.outcome == "stopped"
        assert {effect.name for effect in effects if isinstance(effect, CancelTimer)} == TIMERS
        assert [NODE.ring(after, NOW, name) for name in sorted(TIMERS)] == [(after, ())] * 3
        assert heard(after, 60000, "n8") == (after, (Ignored("outdated"),))
        assert heard(after, 60000, "n8", number=4)[0].open
    won, _ = NODE.stop(NODE.ring(claimed(), NOW, SETTLE)[0])
    assert (won.outcome, heard(won, 60000, "n8")[0].due) == ("won", 0)


def test_a_timer_of_another_piece() -> None:
    with pytest.raises(IllegalEvent, match="no timer 'lease'"):
        NODE.ring(contending(), NOW, "lease")


# --- a frame of each kind is lost ---

TRIO = Field({"n0": (0.0, 0.0), "n1": (30.0, 0.0), "n2": (60.0, 0.0)}, reach_m=45.0, at=lambda u, v: (0.0, 10.0))
"""n0 is the loudest; n0 and n2 hear n1 only."""


def without(among: Field, *lost: tuple[str, str, int], kind: type[Election] = Election) -> Ended:
    """An election in which these frames are lost: a sender, who does not hear, which frame of the sender, from 0."""
    numbers = dict[str, list[int]]()

    def gone(now: int, number: int, sender: str, receiver: str) -> bool:
        of = numbers.setdefault(sender, [])
        if number not in of:
            of.append(number)
        return (sender, receiver, of.index(number)) in lost

    return Air(among, 1, gone, kind).run()


def test_nothing_is_lost() -> None:
    end = without(TRIO)
    assert end.heads == ["n0"]
    assert end.frames == {"n0": 2, "n1": 2, "n2": 2}
    assert end.races["n0"].supporters == {"n1"}


def test_a_lost_claim_is_made_up_for_by_its_repeat() -> None:
    end = without(TRIO, ("n0", "n1", 0))
    assert end.heads == ["n0"]
    assert end.races["n1"].best == Bid(end.races["n0"].own or 0, "n0")


def test_without_a_claim_and_its_repeats_the_next_claims_and_is_answered() -> None:
    """The others take the next loudest for the head, until the first one hears its claim."""
    end = without(TRIO, *(("n0", "n1", n) for n in range(3)))
    assert end.heads == ["n0"]
    deaf = without(TRIO, *(("n0", "n1", n) for n in range(9)))
    assert deaf.heads == ["n0", "n1"]
    assert deaf.races["n2"].best == Bid(deaf.races["n1"].own or 0, "n1")


def test_a_lost_relay_is_made_up_for_by_its_repeat() -> None:
    end = without(TRIO, ("n1", "n2", 0))
    assert end.heads == ["n0"]
    assert not end.races["n2"].claimed or end.races["n2"].outcome == "joined"


def test_without_a_relay_and_its_repeat_the_last_claims_and_is_answered() -> None:
    end = without(TRIO, ("n1", "n2", 0), ("n1", "n2", 1))
    assert end.heads == ["n0"]
    assert (end.races["n2"].claimed, end.races["n2"].outcome) == (True, "joined")
    assert end.frames["n1"] == 3


def test_without_answers_either_the_election_splits() -> None:
    end = without(TRIO, *(("n1", "n2", n) for n in range(OF_ONE)))
    assert end.heads == ["n0", "n2"]
    assert without(TRIO, kind=Plain).heads == ["n0", "n2"]


def test_around_a_hole_by_nodes_that_do_not_sense() -> None:
    """Without them each side has a head; a single one that hears both sides suffices if nothing is lost."""
    beside = {id: at for id, at in HOLE.places.items() if id not in HOLE.deaf}
    for seed in range(5):
        assert len(elected(HOLE, 0.0, seed).heads) == 1
        assert len(elected(replace(HOLE, places=beside, deaf=frozenset()), 0.0, seed).heads) == 2
        one = replace(HOLE, places=beside | {"r1": HOLE.places["r1"]})
        assert len(elected(one, 0.0, seed).heads) == 1


def test_a_hole_two_relays_wide_is_passed_by_answers() -> None:
    """What the first relay says is kept by the second one, and answers the claim at the other side."""
    wide = Field(
        {"n0": (0.0, 0.0), "r0": (40.0, 0.0), "r1": (80.0, 0.0), "n1": (120.0, 0.0)},
        reach_m=45.0,
        at=lambda u, v: (0.0, 10.0),
        deaf=frozenset({"r0", "r1"}),
    )
    end = without(wide)
    assert (end.heads, end.races["n1"].claimed, end.races["n1"].outcome) == (["n0"], True, "joined")
    assert 1 <= end.frames["r1"] <= ANSWERS


def test_an_election_does_not_flood_a_field_of_nodes_that_do_not_sense() -> None:
    """Of a row of them only the first relays."""
    places = {"n0": (0.0, 0.0)} | {f"r{i}": (40.0 * (i + 1), 0.0) for i in range(6)}
    row = Field(places, 45.0, at=lambda u, v: (0.0, 10.0), deaf=frozenset(places) - {"n0"})
    end = without(row)
    assert (end.heads, end.frames["r0"]) == (["n0"], 2)
    assert [end.frames[f"r{i}"] for i in range(1, 6)] == [0] * 5


# --- whatever comes ---

ids = st.sampled_from(["n0", "n4", "n5", "n6", "r0", "zz"])
numbers = st.sampled_from([0, 1, 2, 3, MOST_NUMBER, MOST_NUMBER + 1, 2**31 - 1])
keys = st.integers(0, MOST_KEY) | st.sampled_from([0, 100, WEAKEST, MOST_KEY])
heads = ids.map(str.encode) | st.binary(max_size=32)
expiries = st.integers(STEP - 2, STEP + 2) | st.sampled_from([0, 65535])
messages = st.builds(Claim, numbers, keys, expiries) | st.builds(JoinClaim, numbers, keys, heads, keys, expiries)
acts = (
    st.tuples(st.just("hear"), messages, ids)
    | st.tuples(st.just("ring"), st.sampled_from(sorted(TIMERS)))
    | st.tuples(st.just("begin"), numbers, keys, expiries)
    | st.tuples(st.just("stop"))
)


def acted(race: Race, now: int, act: tuple[Any, ...]) -> tuple[Race, tuple[Effect, ...]]:
    match act:
        case ("hear", message, sender):
            return NODE.hear(race, now, decode(encode(message)), sender, STEP)
        case ("ring", name):
            return NODE.ring(race, now, name)
        case ("begin", number, key, expires):
            return NODE.begin(race, now, number, key, expires)
        case _:
            return NODE.stop(race)


@settings(max_examples=400)
@given(st.lists(st.tuples(st.integers(0, 50 * MS), acts), max_size=60))
def test_nothing_raises_and_frames_are_bounded(steps: list[tuple[int, Any]]) -> None:
    race, now, counts = Race(), NOW, dict[int, int]()
    for wait, act in steps:
        now += wait
        before = race
        race, effects = acted(race, now, act)
        for message in sent(effects):
            counts[message.number] = counts.get(message.number, 0) + 1
            assert decode(encode(message)) == message
        assert all(effect.at >= now for effect in effects if isinstance(effect, SetTimer))
        assert race.number >= before.number
        assert not (race.waiting and race.claimed)
        assert race.outcome != "won" or (race.claimed and race.best == Bid(race.own or 0, "n5"))
        assert race.number > before.number or not before.outcome or race.outcome == before.outcome
    assert all(count <= MOST_FRAMES for count in counts.values())


@settings(max_examples=50)
@given(st.lists(st.integers(0, WEAKEST), min_size=30, max_size=60, unique=True))
def test_a_liar_that_always_improves_makes_nobody_talk_for_ever(better: list[int]) -> None:
    race, frames = claimed(WEAKEST), 1
    for key in sorted(better, reverse=True):
        race, _ = heard(race, key, "zz")
        race, messages = all_relays(race)
        frames += len(messages)
    assert frames <= MOST_FRAMES
    assert race.best == Bid(min(better), "zz")
