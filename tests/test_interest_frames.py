"""Directed diffusion frame by frame: what a process makes of each, and which neighbour it sends data to."""

from __future__ import annotations

from typing import Any

import pytest

from tests.diffusing import REPORT, TASK, Station, interest
from tests.puppet import MS
from trackfield.protocols.interest import interests
from trackfield.protocols.interest.timed import PATIENCE
from trackfield.role import NEIGHBOURHOOD, IllegalEvent, Timer
from trackfield.wire import Doa
from trackfield.wire.interests import Data, DataAck, Interest, Reinforce


@pytest.mark.parametrize("id", [b"", b"a/b", b"\xff", b"a b"])
def test_what_names_nobody_is_ignored(id: bytes) -> None:
    station = Station()
    station.hears(interest(), "a")
    before = station.state
    for message in (
        interest(id),
        Data(id, 1, b"c", 1, 0, 0, REPORT),
        Data(b"base", 1, id, 1, 0, 0, REPORT),
        Data(b"base", 1, id, 1, 0, 2, REPORT),
        Reinforce(id, 1, b"c"),
        Reinforce(b"base", 1, id),
    ):
        assert not station.hears(message, "a")
    assert station.ignored == ["key"] * 6
    assert station.state == before


def test_what_pretends_to_be_its_own_is_ignored() -> None:
    station = Station()
    station.asks(1)
    station.hears(interest(), "a")
    before = station.state
    for message in (interest(b"me"), Data(b"base", 1, b"me", 1, 0, 0, REPORT), Data(b"me", 1, b"me", 1, 0, 0, REPORT)):
        assert not station.hears(message, "a")
    assert not station.hears(interest(b"base", 2), "me")
    assert station.ignored == ["repeated", "unexpected", "unexpected", "unexpected"]
    assert station.state == before


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (Data(b"base", 2, b"c", 1, 0, 0, REPORT), "no interest"),
        (Data(b"base", 2, b"c", 1, 0, 2, REPORT), "no interest"),
        (Reinforce(b"base", 2, b"c"), "no interest"),
        (Reinforce(b"base", 1, b"c"), "unexpected"),
        (DataAck(b"c", 1), "outdated"),
        (Data(b"base", 1, b"c", 1, 63, 0, REPORT), "too many hops"),
        (Data(b"base", 1, b"c", 1, 63, 2, REPORT), "too many hops"),
        (Doa(1, 2.0, 3.0), "unexpected"),
    ],
)
def test_what_has_no_use_is_ignored(message: Any, reason: str) -> None:
    station = Station()
    station.hears(interest(), "a")
    before = station.state
    assert not station.hears(message, "b")
    assert station.ignored == [reason]
    assert station.state == before


def test_data_that_cannot_be_decoded_is_acknowledged_and_ignored() -> None:
    station = Station()
    station.asks(1)
    sent = station.hears(Data(b"me", 1, b"c", 1, 0, 0, b"\xc1"), "a")
    assert sent == [DataAck(b"c", 1), Reinforce(b"me", 1, b"c")]
    assert not station.arrived
    assert len(station.ignored) == 1


def test_only_who_was_sent_a_message_acknowledges_it() -> None:
    station = Station()
    station.hears(interest(), "a")
    station.tells()
    (told,) = (one.message for one in station.sent if isinstance(one.message, Data))
    station.hears(DataAck(b"me", told.serial), "b")
    station.hears(DataAck(b"me", told.serial + 1), "a")
    assert station.ignored == ["outdated", "outdated"]
    assert station.state.traffic.next == "a"
    station.hears(DataAck(b"me", told.serial), "a")
    assert not station.state.traffic.queue
    assert PATIENCE not in station.timers


@pytest.mark.parametrize(("hops", "goes"), [(0, True), (6, True), (7, False), (254, False), (255, False)])
def test_a_refresh_that_comes_further_than_the_first_is_handed_on_as_far_as_it_may_go(hops: int, goes: bool) -> None:
    """The first one waits to be handed on when the next one comes, which was told to have made so many hops."""
    station = Station()
    station.hears(interest(most_hops=8), "a")
    station.hears(interest(refresh=1, hops=hops, most_hops=8), "a")
    station.until(MS * 100)
    told = [one.message for one in station.sent if isinstance(one.message, Interest)]
    assert {one.hops for one in told} == ({hops + 1} if goes else set())


def test_the_pace_is_kept_for_a_bounded_number_of_interests() -> None:
    station = Station()
    for number in range(3 * interests.MOST_INTERESTS):
        station.hears(interest(number=number, interval_s=600.0, lasts_s=0.3, most_hops=1), "a")
        station.tells()
        station.until(station.now + 300 * MS)
    assert 0 < len(station.state.timed.paced) <= interests.MOST_INTERESTS


def data(serial: int, hops: int = 0, spread: int = 0, origin: bytes = b"c") -> Data:
    return Data(b"base", 1, origin, serial, hops, spread, REPORT)


def knowing(**hops: int) -> Station:
    """A process that heard the interest from these neighbours, so many hops from the sink."""
    station = Station()
    for neighbour, far in hops.items():
        station.hears(interest(hops=far), neighbour)
    return station


def to(station: Station) -> str | frozenset[str]:
    """To whom it last sent a report."""
    return [one.to for one in station.sent if isinstance(one.message, Data) and one.message.message][-1]


def acknowledges(station: Station, neighbour: str) -> None:
    first = station.state.traffic.queue[0]
    station.hears(DataAck(first.origin.encode(), first.serial), neighbour)


def test_a_neighbour_that_is_nearer_to_the_sink_comes_first_and_then_one_that_answers() -> None:
    station = knowing(a=2, b=1, c=1)
    station.tells()
    assert to(station) == "b"
    station.until(200 * MS)
    assert to(station) == "c"
    acknowledges(station, "c")
    station.tells()
    assert to(station) == "c"
    acknowledges(station, "c")
    station.hears(interest(refresh=1, hops=1), "b")
    station.hears(interest(refresh=1, hops=1), "c")
    station.tells()
    assert to(station) == "b", "it was heard again"


def test_a_reinforced_path_comes_first_until_its_neighbour_does_not_answer() -> None:
    station = knowing(a=1, b=1)
    station.hears(Reinforce(b"base", 1, b"me"), "d")
    station.tells()
    assert to(station) == "d"
    station.until(200 * MS)
    assert to(station) == "a"
    acknowledges(station, "a")
    station.tells()
    assert to(station) == "a"


def test_data_goes_sideways_only_once() -> None:
    station = knowing(a=1, b=2, d=2)
    station.hears(data(1), "b")
    station.until(200 * MS)
    assert to(station) == NEIGHBOURHOOD, "not to d, which is as far as b"
    station.hears(data(2), "c")
    station.until(400 * MS)
    assert to(station) in ("b", "d"), "it came from further away"


def test_a_flood_goes_on_by_a_gradient_from_who_is_nearer_to_the_sink() -> None:
    station = knowing(a=1, b=3)
    assert station.hears(data(1, spread=2), "b") == [data(1, hops=1)]


def test_a_flood_is_handed_on_once_and_carried_where_it_ends() -> None:
    station = knowing(a=1, b=1)
    for sender in "bdb":
        assert not station.hears(data(1, spread=2), sender)
    station.until(100 * MS)
    assert [one.message for one in station.sent if isinstance(one.message, Data)] == [data(1, hops=1, spread=1)]
    assert station.hears(data(2, spread=1), "b") == [data(2, hops=1)]


def test_a_message_that_comes_back_goes_on_once_more() -> None:
    station = knowing(a=1, b=1, d=1)
    station.hears(data(1), "c")
    acknowledges(station, "a")
    station.hears(data(1, hops=5, spread=2), "b")
    assert station.hears(data(1, hops=1), "d") == [DataAck(b"c", 1)], "one more hop: an acknowledgement was lost"
    assert station.hears(data(1, hops=2), "d") == [DataAck(b"c", 1), data(1, hops=3)]
    acknowledges(station, "a")
    assert station.hears(data(1, hops=8), "d") == [DataAck(b"c", 1)]


def test_a_first_copy_is_reinforced_once() -> None:
    station = knowing(a=1)
    station.hears(data(1), "c")
    assert station.hears(Reinforce(b"base", 1, b"c"), "a") == [Reinforce(b"base", 1, b"c")]
    assert station.sent[-1].to == "c"
    assert not station.hears(Reinforce(b"base", 1, b"c"), "a")
    assert station.ignored[-1] == "unexpected"


def test_the_copy_with_the_fewest_hops_is_told_on() -> None:
    station = knowing(a=3, b=1)
    station.until(100 * MS)
    (told,) = (one.message for one in station.sent if isinstance(one.message, Interest))
    assert told == interest(hops=2)


def test_a_second_copy_of_a_refresh_does_not_change_the_interest() -> None:
    station = knowing(a=0)
    station.hears(interest(lasts_s=600.0), "b")
    station.now = 7000 * MS
    assert not station.piece.live(station.state, station.now, TASK)


def test_an_acknowledgement_that_comes_late_ends_the_message_all_the_same() -> None:
    station = Station()
    station.hears(interest(), "a")
    station.hears(interest(), "b")
    station.tells()
    station.until(200 * MS)
    assert station.state.traffic.tried == ("a",)
    (told, *_) = (one.message for one in station.sent if isinstance(one.message, Data) and one.message.message)
    station.hears(DataAck(b"me", told.serial), "a")
    assert not station.state.traffic.queue
    assert "a" not in station.state.paths.silent


def test_more_interests_than_it_can_keep_are_ignored() -> None:
    station = Station()
    for number in range(interests.MOST_INTERESTS + 3):
        station.hears(interest(number=number), "a")
    assert len(station.state.interests.known) == interests.MOST_INTERESTS
    assert station.ignored == ["too many interests"] * 3
    station.now = 60_000 * MS
    station.hears(interest(number=9999), "a")
    assert list(station.state.interests.known) == [("base", 9999)], "those that expired have made room"


def test_of_many_neighbours_the_nearest_to_the_sink_are_kept() -> None:
    station = Station()
    for i in range(interests.MOST_GRADIENTS + 3):
        station.hears(interest(hops=20 - i), f"n{i:02d}")
    (entry,) = station.state.interests.known.values()
    assert set(entry.gradients) == {f"n{i:02d}" for i in range(3, interests.MOST_GRADIENTS + 3)}
    assert entry.hops == 20 - (interests.MOST_GRADIENTS + 2) + 1


def test_an_interest_that_lasts_no_time_is_never_live() -> None:
    station = Station()
    station.hears(interest(lasts_s=0.0), "a")
    station.until(1000 * MS)
    assert not station.sent
    assert not station.piece.live(station.state, station.now, TASK)


def test_other_events_are_the_drivers_mistake() -> None:
    station = Station()
    for timer in ("interest:patience", "interest:other", "step"):
        with pytest.raises(IllegalEvent):
            station.piece.handle(station.state, Timer(0, timer))
