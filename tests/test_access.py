"""What a router lets each certificate of a run do, by its rules alone; Zenoh says which key includes which."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest
import zenoh
from hypothesis import assume, given
from hypothesis import strategies as st

from launcher.plan.prepare import load, planned
from launcher.records import LAUNCHER, LIVE, RECORDER, ROUTER
from launcher.security.access import MESSAGES, rules
from trackfield.drivers.joining.credentials import GUEST
from trackfield.drivers.session import open_session, router_settings
from trackfield.drivers.spec import ProcessSpec
from trackfield.errors import ScenarioError
from trackfield.wire import keys

RUN = "field-1-0badcafe"
Allows = Callable[[str, str, str, str], bool]


def process(id: str, *cells: str) -> ProcessSpec:
    return ProcessSpec(id, "node", "node.role:Node", cells=cells or ("c0",))


def reader(settings: dict[str, Any]) -> Allows:
    """``allows(name, flow, message, key)`` as Zenoh decides it."""
    assert settings["enabled"] is True
    assert settings["default_permission"] == "deny"
    by_id = {rule["id"]: rule for rule in settings["rules"]}
    granted: dict[str, list[dict[str, Any]]] = {}
    names = {one["id"]: one["cert_common_names"] for one in settings["subjects"]}
    for policy in settings["policies"]:
        for name in (name for subject in policy["subjects"] for name in names[subject]):
            granted.setdefault(name, []).extend(by_id[id] for id in policy["rules"])

    def allows(name: str, flow: str, message: str, key: str) -> bool:
        wanted = zenoh.KeyExpr(key)
        return any(
            rule["permission"] == "allow"
            and flow in rule["flows"]
            and message in rule["messages"]
            and any(zenoh.KeyExpr(one).includes(wanted) for one in rule["key_exprs"])
            for rule in granted.get(name, [])
        )

    return allows


def of(*ids: str, blocks: tuple[tuple[str, ...], ...] = ()) -> Allows:
    return reader(rules(RUN, map(process, ids), blocks))


def own(id: str, life: str) -> list[tuple[str, str, str]]:
    """What the life of a process says, by flow, message and key."""
    at = f"{RUN}/"
    return [
        ("ingress", "put", at + keys.unicast("field", "other", id, "doa")),
        ("ingress", "put", at + keys.broadcast("backbone", "c0", id, "doa")),
        ("ingress", "put", at + keys.telemetry(life, "final")),
        ("ingress", "liveliness_token", at + keys.live(life, "mark")),
        ("ingress", "query", at + keys.asked_by(keys.JOIN, life)),
        ("ingress", "query", at + keys.asked_by(keys.CONFIRM, life)),
        ("ingress", "query", at + keys.asked_by(keys.CLAIM, life)),
        ("egress", "reply", at + keys.asked_by(keys.JOIN, life)),
        ("ingress", "declare_subscriber", at + keys.inbox("field", id)),
        ("egress", "put", at + keys.unicast("field", id, "other", "doa")),
    ]


def shared(life: str) -> list[tuple[str, str, str]]:
    """What every process does."""
    at = f"{RUN}/"
    return [
        ("ingress", "declare_subscriber", at + keys.ORDERS),
        ("ingress", "declare_subscriber", at + keys.orders_to(life)),
        ("ingress", "declare_subscriber", at + keys.neighbourhood("field", "c0")),
        ("egress", "put", at + keys.START),
        ("egress", "put", at + keys.to_groups(keys.START)),
        ("egress", "put", at + keys.broadcast("field", "c0", "other", "doa")),
        ("ingress", "query", at + keys.CLOCK),
        ("ingress", "liveliness_query", at + keys.launcher("*")),
        ("ingress", "liveliness_query", "*/" + keys.launcher("*")),
        ("egress", "liveliness_token", at + keys.launcher("0badcafe")),
    ]


ids = st.from_regex(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,31}", fullmatch=True)
close = ids.flatmap(
    lambda id: st.tuples(st.just(id), st.sampled_from([f"{id}0", f"{id}.", f"{id}-1", f"{id}_", id[:-1]]))
)
lives = st.integers(0, 999_999)


@given(st.tuples(ids, ids) | close, lives, lives)
def test_a_process_does_what_is_its_own_and_nothing_of_another(pair: tuple[str, str], mine: int, others: int) -> None:
    id, other = pair
    assume(id != other and all(keys._ID.fullmatch(one) for one in pair))
    try:
        allows = of(id, other)
    except ScenarioError:
        assume(False)
    life, its = f"{id}~{mine}" if mine else id, f"{other}~{others}" if others else other
    for flow, message, key in own(id, life) + shared(life):
        assert allows(id, flow, message, key), key
    for flow, message, key in own(other, its):
        assert not allows(id, flow, message, key), key


@given(ids, ids, lives)
def test_nothing_is_allowed_in_another_run(id: str, run: str, life: int) -> None:
    assume(run != RUN)
    try:
        allows = of(id)
    except ScenarioError:
        assume(False)
    for flow, message, key in own(id, f"{id}~{life}" if life else id) + shared(id):
        if message != "liveliness_query":  # of which the answers, tokens, are not handed on
            assert not allows(id, flow, message, key.replace(RUN, run, 1)), key


def test_only_the_launcher_answers_orders_and_holds_its_token() -> None:
    allows, at = of("n0", "n1", blocks=(("n0",), ("n1",))), f"{RUN}/"
    only = [
        *(
            ("ingress", "declare_queryable", at + keys.asked_by_all(one))
            for one in (keys.JOIN, keys.CLAIM, keys.CONFIRM)
        ),
        ("ingress", "declare_queryable", at + keys.CLAIM),
        ("ingress", "declare_queryable", at + keys.asked_by(keys.JOIN, "n0")),
        ("ingress", "reply", at + keys.asked_by(keys.JOIN, "n0")),
        *(
            ("ingress", "put", at + one)
            for one in (keys.START, keys.END, keys.STOP, keys.SETTLE, keys.FINISH, keys.LIFE)
        ),
        ("ingress", "put", at + keys.to_groups(keys.STOP)),
        ("ingress", "liveliness_token", at + keys.launcher("0badcafe")),
    ]
    for flow, message, key in only:
        assert allows(LAUNCHER, flow, message, key), key
        for name in ("n0", "n1", RECORDER, LIVE, ROUTER, GUEST, "slice-1", "nobody"):
            assert not allows(name, flow, message, key), (name, key)


WILD = (
    "**", "data/**", "data/*/to/**", "data/*/to/n1/**", "data/*/to/*/*/*", "data/*/all/**", "telemetry/**", "live/**",
    "telemetry/*/*", "control/**", "control/recorder/life", "*/**",
)  # fmt: skip


@pytest.mark.parametrize("key", WILD)
def test_a_process_and_a_guest_neither_put_to_all_nor_read_all(key: str) -> None:
    allows = of("n0", "n1")
    for name in ("n0", GUEST):
        assert not allows(name, "ingress", "put", f"{RUN}/{key}")
    if key != "control/recorder/life":  # among the keys of orders, which all may read
        for name in ("n0", GUEST):
            assert not allows(name, "ingress", "declare_subscriber", f"{RUN}/{key}")
    assert allows(RECORDER, "ingress", "declare_subscriber", f"{RUN}/{key}")
    assert not allows(RECORDER, "ingress", "put", f"{RUN}/{key}")


def test_a_put_to_many_of_ones_own_is_allowed_by_inclusion() -> None:
    allows = of("n0", "n1")
    assert allows("n0", "ingress", "put", f"{RUN}/data/*/to/*/n0/doa")  # receivers refuse keys with wildcards


def test_a_guest_may_only_ask() -> None:
    allows = of("n0")
    asked = [f"{RUN}/{key}" for key in (keys.CLAIM, keys.SLICE, keys.CLOCK)]
    for key in asked:
        assert allows(GUEST, "ingress", "query", key)
        assert allows(GUEST, "egress", "reply", key)
    for flow, message, key in own("n0", "n0"):
        assert not allows(GUEST, flow, message, key), key
    assert not allows("n0", "ingress", "query", f"{RUN}/{keys.CLAIM}")  # whose answer has others' certificates


def test_a_slice_does_what_its_processes_do_and_no_more() -> None:
    allows = of("n0", "n1", "n2", blocks=(("n0", "n2"), ("n1",)))
    first, second = keys.slice_name(1), keys.slice_name(2)
    for flow, message, key in [*own("n0", "n0~3"), *own("n2", "n2"), *shared("n0")]:
        assert allows(first, flow, message, key), key
    for flow, message, key in own("n1", "n1"):
        assert not allows(first, flow, message, key), key
        assert allows(second, flow, message, key), key
    assert allows(first, "ingress", "query", f"{RUN}/{keys.SLICE}")
    assert allows(first, "egress", "declare_subscriber", f"{RUN}/{keys.ALL_DATA}")  # else it hands nothing on
    assert not allows(first, "ingress", "query", f"{RUN}/{keys.CLAIM}")
    assert not allows(first, "ingress", "declare_subscriber", f"{RUN}/{keys.ALL_DATA}")


@pytest.mark.parametrize("id", [LAUNCHER, ROUTER, RECORDER, LIVE, GUEST, "slice-1", "slice-12"])
def test_an_id_that_is_a_name_of_something_else_is_refused(id: str) -> None:
    with pytest.raises(ScenarioError, match="cannot be the id of a process in a secured run"):
        rules(RUN, [process("n0"), process(id)])


def test_cells_of_all_lives_are_heard() -> None:
    lives = [process("n0", "c1"), ProcessSpec("n0", "node", "node.role:Node", incarnation=1, cells=("c2",))]
    allows = reader(rules(RUN, lives))
    for cell, heard in (("c1", True), ("c2", True), ("c3", False)):
        assert allows("n0", "ingress", "declare_subscriber", f"{RUN}/{keys.neighbourhood('field', cell)}") is heard


def test_zenoh_takes_the_rules_of_a_whole_field() -> None:
    plan = planned(load("zhai-spcpf"))
    settings = rules(plan.run.run, plan.processes, [sorted(plan.in_field)[:60], sorted(plan.in_field)[60:]])
    assert {message for rule in settings["rules"] for message in rule["messages"]} <= set(MESSAGES)
    assert len({one["id"] for one in settings["subjects"]}) == len(plan.ids) + 7  # tools, two slices
    with open_session(router_settings([], more={"access_control": json.loads(json.dumps(settings))})):
        pass
