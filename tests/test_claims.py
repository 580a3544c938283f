"""Places for whoever comes: an offer keeps none, each has one process at a time, and a host finds its own again."""

from __future__ import annotations

import pytest

from launcher.processes.places.claims import GRACE_S, OFFERED_S, Claims

FIELD = {"fusion": "fusion", "n000": "node", "n001": "node"}


def settled() -> Claims:
    """Hosts a and b live at n000 and n001."""
    claims = Claims(FIELD)
    for host, place in (("a", "n000"), ("b", "n001")):
        assert claims.offer("node", host, 0.0) == place
        claims.came(place, 1.0)
        claims.known(place, host)
    return claims


def test_places_are_offered_in_order_by_role_until_there_are_none() -> None:
    claims = settled()
    assert claims.offer("node", "c", 2.0) is None
    assert claims.offer("fusion", "c", 2.0) == "fusion"
    assert [claims.had(place) for place in FIELD] == [False, True, True]


def test_a_role_that_nobody_has_is_an_error() -> None:
    with pytest.raises(LookupError, match="no process of this run has the role 'gateway'"):
        Claims(FIELD).offer("gateway", "a", 0.0)


@pytest.mark.parametrize("wanted", ["n002", "fusion", "n000~1"])
def test_a_place_that_the_role_does_not_have_is_an_error(wanted: str) -> None:
    with pytest.raises(LookupError, match=f"no process of this run with the role 'node' is named '{wanted}'"):
        Claims(FIELD).offer("node", "a", 0.0, wanted)


def test_a_named_place_is_offered_while_nobody_lives_there() -> None:
    claims = settled()
    assert claims.offer("node", "c", 2.0, "n001") is None
    claims.went("n001", 3.0)
    assert claims.offer("node", "c", 3.0) is None  # kept for its host
    assert claims.offer("node", "c", 3.0, "n001") == "n001"


def test_a_host_gets_its_own_place_back_at_once() -> None:
    claims = settled()
    claims.went("n000", 10.0)
    claims.went("n001", 10.0)
    assert claims.offer("node", "b", 10.0) == "n001"
    assert claims.offer("node", "a", 10.0) == "n000"


def test_its_own_place_comes_before_one_that_nobody_ever_had() -> None:
    claims = Claims({**FIELD, "n002": "node"})
    claims.offer("node", "a", 0.0)
    claims.came("n001", 1.0)
    claims.known("n001", "b")
    claims.went("n001", 2.0)
    assert claims.offer("node", "b", 2.0) == "n001"
    assert claims.offer("node", "c", 2.0) == "n002"


def test_an_abandoned_place_goes_to_another_after_a_while() -> None:
    claims = settled()
    claims.went("n000", 10.0)
    assert claims.offer("node", "c", 10.0 + GRACE_S) is None
    assert claims.offer("node", "c", 10.1 + GRACE_S) == "n000"
    claims.came("n000", 11.0 + GRACE_S)
    assert claims.offer("node", "a", 99.0) is None  # too late


def test_a_place_that_came_back_is_not_abandoned() -> None:
    """The container was cut off for a while; its process never ended."""
    claims = settled()
    claims.went("n000", 10.0)
    claims.came("n000", 15.0)
    assert claims.offer("node", "c", 99.0) is None


def test_several_processes_of_one_host_are_offered_a_place_each() -> None:
    """Started at once, none of them was seen to live yet when the next one asks."""
    claims = Claims(FIELD)
    assert [claims.offer("node", "a", now) for now in (0.0, 0.1)] == ["n000", "n001"]


def test_offers_keep_nothing_and_go_around() -> None:
    """Whoever only asks cannot keep others out: the place that was offered longest ago is offered next."""
    claims = Claims({**FIELD, "n002": "node"})
    offers = [claims.offer("node", "stranger", i / 1000) for i in range(3000)]
    assert offers[:6] == ["n000", "n001", "n002"] * 2
    claims.came("n001", 3.0)
    assert [claims.offer("node", "a", 3.0 + i / 1000) for i in range(4)] == ["n000", "n002"] * 2


def test_a_place_whose_process_never_came_is_offered_as_new() -> None:
    claims = Claims(FIELD)
    assert claims.offer("node", "a", 0.0) == "n000"
    assert claims.offer("node", "b", OFFERED_S) == "n000"
    assert not claims.had("n000")


def test_a_place_that_was_taken_by_name_is_taken() -> None:
    claims = Claims(FIELD)
    claims.came("n000", 0.0)
    assert claims.offer("node", "a", 0.0) == "n001"
    claims.came("n001", 1.0)
    assert claims.offer("node", "b", 99.0) is None
