"""Keys: who sends what to whom."""

from __future__ import annotations

from typing import Any

import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st

from trackfield.wire import WireError, keys
from trackfield.wire.keys import Address, broadcast, check_id, inbox, neighbourhood, parse, unicast

ids = st.from_regex(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,31}", fullmatch=True)
media = st.sampled_from(keys.MEDIA)


def test_the_keys_in_full() -> None:
    assert unicast("field", "fusion", "n060", "doa") == "data/field/to/fusion/n060/doa"
    assert broadcast("backbone", "c3", "gw", "track") == "data/backbone/all/c3/gw/track"
    assert keys.telemetry("n060", "counts") == "telemetry/n060/counts"
    assert keys.live("n060") == "live/n060"
    assert inbox("field", "fusion") == "data/field/to/fusion/**"
    assert neighbourhood("field", "c3") == "data/field/all/c3/**"
    assert keys.telemetry_of_all("counts") == "telemetry/*/counts"
    assert (keys.JOIN, keys.START, keys.STOP) == ("control/join", "control/start", "control/stop")


def test_orders_reach_every_group_and_nothing_else_does() -> None:
    groups = {keys.orders_to(f"n{number:04}") for number in range(3000)}
    assert len(groups) == keys.GROUPS
    order = zenoh.KeyExpr(keys.to_groups(keys.START))
    assert all(order.intersects(zenoh.KeyExpr(group)) for group in groups)
    others = [
        keys.START,
        keys.JOIN,
        keys.ORDERS,
        keys.LIFE,
        keys.to_groups(keys.LIFE),
        keys.telemetry("n060", "counts"),
    ]
    assert not any(zenoh.KeyExpr(other).intersects(zenoh.KeyExpr(group)) for other in others for group in groups)
    assert keys.order_of(str(order)) == keys.order_of(keys.START) == keys.START


@given(media, ids, ids, ids)
def test_parse_is_the_inverse(medium: str, target: str, src: str, kind: str) -> None:
    assert parse(unicast(medium, target, src, kind)) == Address(medium, target, None, src, kind)
    assert parse(broadcast(medium, target, src, kind)) == Address(medium, None, target, src, kind)


@given(st.text() | st.from_regex(r"data(/[a-z*@]{0,9}){3,6}", fullmatch=True))
def test_no_key_crashes_the_parser(key: str) -> None:
    try:
        address = parse(key)
    except WireError as error:
        assert error.reason == "key"
    else:
        assert key.split("/")[1] == address.medium


@pytest.mark.parametrize(
    "key",
    [
        "",
        "data",
        "data/field/to/fusion/n060",
        "data/field/to/fusion/n060/doa/x",
        "data/field/from/fusion/n060/doa",
        "data/air/to/fusion/n060/doa",
        "data/field/to//n060/doa",
        "data/field/to/*/n060/doa",
        "data/field/to/fusion/@n060/doa",
        "run/data/field/to/fusion/n060/doa",
        "telemetry/n060/counts",
        b"data/field/to/fusion/n060/doa",
        None,
    ],
)
def test_not_a_data_key(key: Any) -> None:
    with pytest.raises(WireError) as caught:
        parse(key)
    assert caught.value.reason == "key"


@pytest.mark.parametrize("text", ["n060", "0", "_", "a.b-c_d", "A" * 32])
def test_ids(text: str) -> None:
    assert check_id(text) == text


@pytest.mark.parametrize(
    "text",
    ["", "a/b", "a*", "$a", "a?", "a#b", "@a", ".hidden", "-v", "a b", "ä", "a\n", "A" * 33, None, 7, b"a"],
)
def test_not_ids(text: object) -> None:
    with pytest.raises(WireError) as caught:
        check_id(text)
    assert caught.value.reason == "key"


@pytest.mark.parametrize(
    "build",
    [
        lambda bad: unicast("field", bad, "a", "k"),
        lambda bad: unicast("field", "a", bad, "k"),
        lambda bad: unicast("field", "a", "b", bad),
        lambda bad: unicast(bad, "a", "b", "k"),
        lambda bad: broadcast("field", bad, "a", "k"),
        lambda bad: broadcast("field", "c", bad, "k"),
        lambda bad: broadcast("field", "c", "a", bad),
        lambda bad: broadcast(bad, "c", "a", "k"),
        lambda bad: inbox("field", bad),
        lambda bad: inbox(bad, "a"),
        lambda bad: neighbourhood("field", bad),
        lambda bad: neighbourhood(bad, "c"),
        lambda bad: keys.telemetry(bad, "counts"),
        lambda bad: keys.telemetry("a", bad),
        keys.telemetry_of_all,
        keys.live,
    ],
)
def test_no_builder_lets_a_wildcard_through(build: Any) -> None:
    with pytest.raises(WireError):
        build("*")


@pytest.mark.parametrize("name", ["fusion", "n060~1", "A" * 32 + "~123456"])
def test_a_later_life_tells_under_its_own_name(name: str) -> None:
    assert keys.live(name) == f"live/{name}"
    assert keys.telemetry(name, "final") == f"telemetry/{name}/final"
    assert keys.id_of(name) == name.partition("~")[0]
    assert zenoh.KeyExpr(keys.telemetry_of_all("final")).includes(zenoh.KeyExpr(keys.telemetry(name, "final")))


@pytest.mark.parametrize("name", ["~1", "a~", "a~0", "a~01", "a~b", "a~1~2", "a~1/b", "a~1234567", "*~1", None, 7])
def test_not_the_name_of_a_life(name: Any) -> None:
    with pytest.raises(WireError) as caught:
        keys.live(name)
    assert caught.value.reason == "key"


def test_a_frame_names_its_process_and_no_life() -> None:
    with pytest.raises(WireError):
        unicast("field", "fusion", "n060~1", "doa")


@pytest.mark.parametrize("medium", keys.MEDIA)
def test_subscriptions_match_their_own_frames_only(medium: str) -> None:
    """Told by Zenoh's own matcher, which decides in the end."""
    wanted = [inbox(medium, "n1"), neighbourhood(medium, "c0"), neighbourhood(medium, "c1")]

    def matches(key: str) -> int:
        return sum(zenoh.KeyExpr(one).intersects(zenoh.KeyExpr(key)) for one in wanted)

    other = "backbone" if medium == "field" else "field"
    assert matches(unicast(medium, "n1", "n2", "doa")) == 1
    assert matches(broadcast(medium, "c0", "n2", "doa")) == 1
    assert matches(broadcast(medium, "c1", "n2", "doa")) == 1
    for key in (
        unicast(other, "n1", "n2", "doa"),
        broadcast(other, "c0", "n2", "doa"),
        unicast(medium, "n10", "n2", "doa"),
        unicast(medium, "c0", "n1", "doa"),
        broadcast(medium, "c2", "n1", "doa"),
        broadcast(medium, "n1", "n2", "doa"),
    ):
        assert matches(key) == 0


def test_the_wildcards_cover_their_plane() -> None:
    for wildcard, key in [
        (keys.ALL_DATA, unicast("field", "a", "b", "doa")),
        (keys.ALL_DATA, broadcast("backbone", "c", "b", "doa")),
        (keys.ALL_TELEMETRY, keys.telemetry("a", "counts")),
        (keys.ALL_LIVE, keys.live("a")),
        (keys.telemetry_of_all("counts"), keys.telemetry("a", "counts")),
    ]:
        assert zenoh.KeyExpr(wildcard).includes(zenoh.KeyExpr(key))
