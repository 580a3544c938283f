"""Terms: which is higher, who follows, who yields, and when it is whose turn to take over."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from trackfield.protocols.lease import MOST_NUMBER, TAKE_OVER, TIMER, Held, Lease, Term
from trackfield.role import NS, CancelTimer, SetTimer

LEASE = Lease("m1", 4 * NS, 40)
STOPS = (CancelTimer(TIMER), CancelTimer(TAKE_OVER))

terms = st.builds(Term, st.integers(0, 9), st.sampled_from(["m0", "m1", "m2"]))


def test_the_order_of_terms() -> None:
    """By number and then by id; nobody is lower than anybody."""
    assert Term() < Term(0, "m0") < Term(1, "") < Term(1, "m0") < Term(1, "m1") < Term(2, "") < Term(MOST_NUMBER, "")


def test_a_higher_term_is_followed() -> None:
    held, effects, news = LEASE.hear(LEASE.begin(), 100, Term(1, "m0"), direct=True, near=False)
    assert (held, news) == (Held(Term(1, "m0"), watched=True, heard_ns=100), "follows")
    assert effects == (SetTimer(TIMER, 100 + 4 * NS), CancelTimer(TAKE_OVER))
    held, _, news = LEASE.hear(held, 200, Term(1, "m2"), direct=True, near=False)
    assert (held.term, news) == (Term(1, "m2"), "follows")


def test_a_leader_out_of_reach_is_followed_but_not_watched() -> None:
    held, effects, news = LEASE.hear(LEASE.begin(), 100, Term(1, "m0"), direct=False, near=False)
    assert (held, news, effects) == (Held(Term(1, "m0"), heard_ns=100), "follows", STOPS)
    assert LEASE.silent(held, 200, 0) is None
    near, effects, _ = LEASE.hear(LEASE.begin(), 100, Term(1, "m0"), direct=False, near=True)
    assert (near.watched, effects[0]) == (True, SetTimer(TIMER, 100 + 4 * NS))


def test_only_the_leader_itself_shows_that_it_is_alive() -> None:
    held = Held(Term(3, "m0"), watched=True)
    assert LEASE.hear(held, 100, held.term, direct=False, near=True) == (held, (), "")
    _, effects, news = LEASE.hear(held, 100, held.term, direct=True, near=True)
    assert (effects, news) == ((SetTimer(TIMER, 100 + 4 * NS), CancelTimer(TAKE_OVER)), "")


def test_a_lower_term_is_outdated() -> None:
    held = Held(Term(3, "m0"), watched=True)
    for term in (Term(2, "m2"), Term(2, "m0"), Term(3, "")):
        assert LEASE.hear(held, 100, term, direct=True, near=True) == (held, (), "outdated")


def test_a_leader_yields_to_a_higher_term_only() -> None:
    held, effects = LEASE.lead(Held(Term(1, "m0"), watched=True), 2)
    assert (held, effects) == (Held(Term(2, "m1")), STOPS)
    assert held.leads("m1")
    assert LEASE.hear(held, 100, Term(2, "m0"), direct=True, near=True)[2] == "outdated"
    assert LEASE.hear(held, 100, Term(2, "m1"), direct=False, near=True) == (held, (), "")
    after, _, news = LEASE.hear(held, 100, Term(2, "m2"), direct=True, near=True)
    assert (after.term, after.watched, news) == (Term(2, "m2"), True, "yielded")


def test_nobody_is_told_by_others_that_it_leads() -> None:
    held = Held(Term(1, "m0"), watched=True)
    assert LEASE.hear(held, 100, Term(7, "m1"), direct=False, near=True) == (held, (), "outdated")


def test_a_leader_that_hands_over_watches_the_next() -> None:
    led, _ = LEASE.lead(LEASE.begin(), 1)
    assert LEASE.follow(led, 100, Term(2, "m2")) == (
        Held(Term(2, "m2"), watched=True, heard_ns=100),
        (SetTimer(TIMER, 100 + 4 * NS),),
    )


def test_a_term_that_is_over_is_not_taken_over_or_followed() -> None:
    held = Held(Term(3, "m0"), watched=True)
    assert LEASE.end(held, 2) == (held, ())
    over, effects = LEASE.end(held, 3)
    assert effects == STOPS
    assert LEASE.silent(over, 100, 0) is None
    assert LEASE.hear(over, 100, Term(3, "m0"), direct=True, near=True) == (over, (), "outdated")
    # Another one of this number did not end, and neither has the next.
    for term in (Term(3, "m2"), Term(4, "m0")):
        assert LEASE.hear(over, 100, term, direct=True, near=True)[2] == "follows"


def test_when_it_is_whose_turn() -> None:
    held = Held(Term(3, "m0"), watched=True)
    assert [LEASE.silent(held, 1000, rank) for rank in range(3)] == [
        SetTimer(TAKE_OVER, at) for at in (1040, 1080, 1120)
    ]
    assert LEASE.silent(Held(Term(3, "m1"), watched=True), 1000, 0) is None


def test_who_heard_the_leader_of_late_vouches_for_it() -> None:
    held, _, _ = LEASE.hear(LEASE.begin(), 100, Term(3, "m0"), direct=True, near=True)
    assert LEASE.vouches(held, 100 + 2 * NS - 1, Term(3, "m0"))
    assert not LEASE.vouches(held, 100 + 2 * NS, Term(3, "m0"))
    assert not LEASE.vouches(held, 200, Term(2, "m0"))
    led, _ = LEASE.lead(LEASE.begin(), 3)
    assert LEASE.vouches(led, 100 * NS, Term(3, "m1"))


def test_a_leader_that_others_vouch_for_is_waited_for_once_more() -> None:
    held = Held(Term(3, "m0"), watched=True, heard_ns=100)
    again = (SetTimer(TIMER, 5 * NS + 4 * NS), CancelTimer(TAKE_OVER))
    assert LEASE.vouched(held, 5 * NS, Term(3, "m0")) == again
    assert LEASE.vouched(held, 5 * NS, Term(2, "m0")) == ()
    assert LEASE.vouched(Held(Term(3, "m0")), 5 * NS, Term(3, "m0")) == ()


@given(st.lists(st.tuples(terms, st.booleans(), st.booleans()), max_size=20))
def test_what_is_held_never_becomes_lower_whatever_is_heard(heard: list[tuple[Term, bool, bool]]) -> None:
    held = LEASE.begin()
    for now, (term, direct, near) in enumerate(heard):
        after, effects, news = LEASE.hear(held, now, term, direct=direct, near=near)
        assert after.term >= held.term
        assert (after.term != held.term) == (news in ("follows", "yielded"))
        assert (news == "outdated") == (term < held.term or (term.leader == "m1" and term != held.term))
        assert all(effect.at == now + 4 * NS for effect in effects if isinstance(effect, SetTimer))
        held = after


@given(st.lists(terms, max_size=12), st.lists(terms, max_size=12))
def test_those_who_hear_the_same_agree_in_whatever_order(some: list[Term], others: list[Term]) -> None:
    lease, all_heard = Lease("m9", 4 * NS, 40), [*some, *others]
    found = set()
    for order in (all_heard, [*others, *some], sorted(all_heard), all_heard[::-1]):
        held = lease.begin()
        for term in order:
            held, _, _ = lease.hear(held, 0, term, direct=True, near=True)
        found.add(held.term)
    assert found == {max([Term(), *all_heard])}
