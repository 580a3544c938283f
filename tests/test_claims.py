"""Places for whoever comes: each has one process at a time, and a host finds its own again."""

from __future__ import annotations

import pytest

from launcher.processes.claims import GRACE_S, STARTING_S, Claims

FIELD = {"fusion": "fusion", "n000": "node", "n001": "node"}


def settled() -> Claims:
    """Hosts a and b live at n000 and n001."""
    claims = Claims(FIELD)
    for host, place in (("a", "n000"), ("b", "n001")):
        assert claims.take("node", host, 0.0) == (place, False)
        claims.seen(place, live=True, now=1.0)
    return claims


def test_places_are_given_in_order_by_role_until_there_are_none() -> None:
    claims = settled()
    assert claims.take("node", "c", 2.0) is None
    assert claims.take("fusion", "c", 2.0) == ("fusion", False)
    assert claims.take("fusion", "c", 2.0) is None


def test_a_role_that_nobody_has_is_an_error() -> None:
    with pytest.raises(LookupError, match="no process of this run has the role 'gateway'"):
        Claims(FIELD).take("gateway", "a", 0.0)


def test_a_host_gets_its_own_place_back_at_once() -> None:
    claims = settled()
    claims.seen("n000", live=False, now=10.0)
    claims.seen("n001", live=False, now=10.0)
    assert claims.take("node", "b", 10.0) == ("n001", True)
    assert claims.take("node", "a", 10.0) == ("n000", True)


def test_its_own_place_comes_before_one_that_nobody_ever_had() -> None:
    claims = Claims({**FIELD, "n002": "node"})
    for host in ("a", "b"):
        claims.take("node", host, 0.0)
    claims.seen("n001", live=True, now=1.0)
    claims.seen("n001", live=False, now=2.0)
    assert claims.take("node", "b", 2.0) == ("n001", True)
    assert claims.take("node", "c", 2.0) == ("n002", False)


def test_an_abandoned_place_goes_to_another_after_a_while() -> None:
    claims = settled()
    claims.seen("n000", live=False, now=10.0)
    assert claims.take("node", "c", 10.0 + GRACE_S) is None
    assert claims.take("node", "c", 10.1 + GRACE_S) == ("n000", True)
    claims.seen("n000", live=True, now=11.0 + GRACE_S)
    assert claims.take("node", "a", 99.0) is None  # too late


def test_a_place_that_came_back_is_not_abandoned() -> None:
    """The container was cut off for a while; its process never ended."""
    claims = settled()
    claims.seen("n000", live=False, now=10.0)
    claims.seen("n000", live=True, now=15.0)
    assert claims.take("node", "c", 99.0) is None


def test_several_processes_of_one_host_have_a_place_each() -> None:
    """Started at once, none of them was seen to live yet when the next one asks."""
    claims = Claims(FIELD)
    assert [claims.take("node", "a", now) for now in (0.0, 0.1, 0.2)] == [("n000", False), ("n001", False), None]


def test_a_place_whose_process_never_came_is_given_again_as_new() -> None:
    claims = Claims(FIELD)
    claims.take("fusion", "a", 0.0)
    assert claims.take("fusion", "a", STARTING_S) is None
    assert claims.take("fusion", "a", STARTING_S + 0.1) == ("fusion", False)


def test_a_place_that_was_taken_by_name_is_taken() -> None:
    claims = Claims(FIELD)
    claims.seen("n000", live=True, now=0.0)
    claims.seen("recorder", live=True, now=0.0)
    assert claims.take("node", "a", 0.0) == ("n001", False)
    assert claims.take("node", "b", 99.0) == ("n001", False)  # a's never came
