"""Processes of several roles, from the architecture that names them to the figures of a run, in both drivers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

import trackfield as tf
from launcher.plan.architectures import ARCHITECTURES
from launcher.plan.extensions import check_importable
from launcher.plan.prepare import planned, remarks
from launcher.record.ledger import Ledger
from launcher.record.metrics import cut_off, run_metrics
from launcher.study.compare import differences
from tests.pairs import Paired, Tally
from tests.running import SPEEDS, kept_up
from trackfield.drivers.spec import factory_of, make_role, role_places
from trackfield.drivers.virtual import Virtual
from trackfield.host import Host
from trackfield.protocols.timesync import SPREAD_NS, TimeSync
from trackfield.role import NS, SetTimer, Started

SMALL = {"field.nodes": 9, "target.steps": 6, "architecture.kind": "own", "clock.offset_ms": 10}
FIGURES = ["delivered", "ignored"]
TALLY = "tests.pairs:Tally"


@pytest.fixture(autouse=True)
def registry() -> Any:
    """What a test registers is gone after it."""
    yield
    ARCHITECTURES.registered.clear()


def paired(
    roles: Mapping[Any, Any] | None = None, changes: Mapping[str, Any] | None = None, **more: Any
) -> tf.Scenario:
    """A small scenario with a head as in ``Paired``, and ``more`` settings."""

    @dataclass(frozen=True)
    class Own:
        def arrange(self, field: tf.Field) -> tf.Arranged:
            return Paired(roles, changes).arrange(field)

    tf.register_architecture("own", Own)
    return tf.Scenario.load("zhai-spcpf", {**SMALL, **more})


# --- what cannot be -----------------------------------------------------------------------------------------------


class Teller(Tally):
    """Tells the time, beside the fusion centre that does so, too."""

    def __init__(self) -> None:
        super().__init__(since=0)
        self.kinds = TimeSync().kinds


def since(number: Any, **more: Any) -> tf.Hosted:
    return tf.Hosted(Tally, {"since": number}, **more)


WRONG: dict[str, tuple[dict[Any, Any], dict[str, Any], str]] = {
    "list": ({}, {"roles": ["node"]}, "roles: is ['node']; expected a dict of a Hosted for each role by its name"),
    "class": ({"x": Tally}, {}, "expected a dict of a Hosted for each role by its name"),
    "name": ({"a/b": since(2)}, {}, "roles: the name of a role is 'a/b'; expected 1 to 32 characters"),
    "number": ({3: since(2)}, {}, "roles: the name of a role is 3; expected 1 to 32 characters"),
    "config": ({"x": tf.Hosted(Tally, 3)}, {}, "roles.x.config: is 3; expected a dict of its role's arguments"),  # type: ignore[arg-type]
    "clock": ({"x": since(2, clock="asks")}, {}, "roles.x.clock: is 'asks'; expected keeps, follows, or ''"),
    "both": ({}, {"factory": Tally}, "roles: are given beside a factory or a config; expected those of each role"),
    "fuse": ({"x": since(2, fuses=True)}, {}, "roles: reports are fused by fusion and x; expected one with fuses"),
    "no fuses": ({}, {"fuses": ()}, "roles: reports are fused by fusion; expected one with fuses = True if the"),
    "none fuses": ({"fusion": since(2, clock="keeps")}, {}, "roles: reports are fused by none; expected one with"),
    "two ask": ({"x": tf.Hosted(clock="keeps")}, {}, "roles: the clock is kept by fusion and x; expected one with"),
    "none asks": ({"fusion": tf.Hosted(fuses=True)}, {}, "roles: the clock is kept by none; expected one with clock"),
    "two tell": ({"x": tf.Hosted(Teller)}, {}, "roles: each of fusion, x tells the time; expected one role that does"),
    "argument": ({"x": tf.Hosted(Tally)}, {}, "roles.x.config: tests.pairs:Tally makes no role of these arguments ("),
    "unsendable": ({"x": since({1})}, {}, "roles.x.config: cannot be sent to it (can not serialize 'set'"),
    "missing": ({"x": tf.Hosted("strangers:Tally")}, {}, "roles.x.factory: cannot be loaded from strangers:Tally (Mod"),
    "unknown": ({"x": tf.Hosted()}, {}, "no installed package offers the role 'x'; expected a Process with a factory"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_what_cannot_be_is_refused_with_one_message(name: str) -> None:
    roles, changes, message = WRONG[name]
    with pytest.raises(tf.ScenarioError) as caught:
        planned(paired(roles, changes))
    assert message in str(caught.value)
    assert len(caught.value.parts) == 1


class Deaf(Tally):
    """Takes the argument with which a role follows the clock, and does not follow it."""

    def __init__(self, *, sync: Mapping[str, Any]) -> None:
        super().__init__(since=len(sync))


def test_a_role_that_is_to_follow_the_clock_must_do_so() -> None:
    """Otherwise it would go by a wrong clock, and nobody would notice."""
    said = r"roles\.x\.clock: what .*:Deaf makes does not follow a clock; expected a role with"
    with pytest.raises(tf.ScenarioError, match=said):
        planned(paired({"x": tf.Hosted(Deaf, clock="follows")}))


def test_a_role_within_a_function_works_in_virtual_time_only() -> None:
    class Local(Tally):
        pass

    plan = planned(paired({"tally": tf.Hosted(Local, {"since": 2})}))
    with pytest.raises(tf.ScenarioError, match=r"role 'tally': is defined in a function .*, where other processes"):
        check_importable(plan)
    check_importable(planned(paired()))


# --- what each role is given --------------------------------------------------------------------------------------


def test_each_role_gets_its_own_arguments_and_what_the_launcher_adds() -> None:
    plan = planned(paired())
    head = plan.processes[1]
    places = {"node": "node.role:Node", "fusion": "fusion.role:Fusion", "tally": TALLY}
    assert (role_places(head.factory), factory_of(places)) == (places, head.factory)
    assert list(head.config) == list(places)
    assert plan.bank_of("n004").items() <= head.config["fusion"].items()
    assert "trackers" not in head.config["node"]
    sync = head.config["fusion"]["sync"]
    assert sync["reference"] == "base"
    assert head.config["node"]["sync"] == {"follows_ns": SPREAD_NS + sync["exchanges"] * sync["timeout_ns"]}
    assert head.config["tally"] == {"since": 2}
    assert remarks(plan) == []


def test_roles_do_not_wait_for_a_clock_that_is_right() -> None:
    head = planned(paired(**{"clock.offset_ms": 0})).processes[1]
    assert "sync" not in head.config["fusion"]
    assert head.config["node"]["sync"] == {"follows_ns": 0}


def test_events_come_to_roles_in_the_order_of_the_plan() -> None:
    """Who starts the process by hand may name them in another order."""
    factory, config = factory_of({"b": TALLY, "a": TALLY}), {"a": {"since": 1}, "b": {"since": 2}}
    role = make_role(factory, config, "me")
    assert isinstance(role, Host)
    assert list(role.roles) == ["a", "b"]
    assert role.roles["b"].since == 2  # type: ignore[attr-defined]
    with pytest.raises(ValueError, match="its roles are b, a, not a"):
        make_role(factory, {"a": {"since": 1}}, "me")


def test_a_process_may_have_a_single_role_with_a_name() -> None:
    role = make_role(f"a={TALLY}", {"a": {"since": 1}}, "me")
    assert role.handle(role.begin(), Started(0))[1] == (SetTimer("a/store", NS),)


# --- whole runs ---------------------------------------------------------------------------------------------------

HARD = {
    "target.steps": 10,
    "link.model": "lognormal_prr",
    "energy.battery_j": 5.0,
    "faults": [{"kind": "restart", "nodes": ["n004"], "at_s": 5, "until_s": 6.5}],
}


def test_a_hosted_process_is_the_same_over_processes(tmp_path: Path) -> None:
    """Over a lossy radio, with clocks that are off, and a restart in which each role goes on from its own bytes."""
    scenario = paired(**HARD)
    virtual = tf.run(scenario, out=tmp_path / "virtual")
    for speed in SPEEDS:
        real = tf.run(scenario, driver="processes", speed=speed, out=tmp_path / f"processes-{speed}")
        if kept_up(real.metrics.plain()):
            break
    assert list(differences(virtual.path, real.path, 0.0)) == []
    assert real.metrics.energy_j == virtual.metrics.energy_j
    roles = virtual.metrics.frames.by_role
    assert real.metrics.frames.by_role == roles
    assert (roles["node"].delivered, roles["node"].ignored) == (0, 0)
    assert roles["tally"].delivered > roles["tally"].ignored == 2
    kinds = [row["kind"] for row in real.messages.to_pylist() if row["dst"] == "n004" and row["outcome"] != "radio"]
    assert roles["fusion"].delivered + roles["tally"].delivered <= len(kinds)


def lived(scenario: tf.Scenario) -> tuple[Virtual, Ledger]:
    """All that was left of a run in virtual time."""
    plan = planned(scenario)
    ledger = Ledger(plan.run, plan.processes)
    virtual = Virtual(plan.run, plan.processes, ledger)
    virtual.run()
    return virtual, ledger


def test_each_role_goes_on_from_its_own_bytes() -> None:
    """The tally goes on counting where it was, the centre with its track."""
    virtual, ledger = lived(paired(**{**HARD, "link.model": "ideal"}))
    first, second = (virtual.cores[name].state for name in ("n004", "n004~1"))
    heard = ledger.finals["n004~1"]["roles"]["tally"]
    assert int(first.stored["tally"]) > 0
    assert second.states["tally"] == int(first.stored["tally"]) + heard["delivered"]
    assert [ledger.finals[name]["roles"]["tally"]["ignored"] for name in ("n004", "n004~1")] == [2, 0]
    assert first.states["fusion"].progress.tracks[0].track is not None
    assert second.states["fusion"].progress.tracks[0].track is not None


def test_all_roles_of_a_process_have_one_clock() -> None:
    virtual, _ = lived(paired(**{"clock.offset_ms": 200}))
    node, fusion = (virtual.cores["n004"].state.states[name].time for name in ("node", "fusion"))
    assert node.known
    assert node.correction_ns == fusion.correction_ns != 0
    assert node.asked == 0 < fusion.asked


def test_readings_of_its_own_sensor_reach_its_centre_without_a_frame(tmp_path: Path) -> None:
    """Nothing is lost on that way, or paid for; but a replay cannot know them, and says so."""
    run = tf.run(paired(), out=tmp_path / "run")
    assert any("n004" in row["sensors"] for row in run.tracks.to_pylist())
    assert not [row for row in run.messages.to_pylist() if (row["src"], row["kind"]) == ("n004", "doa")]
    with pytest.raises(tf.ScenarioError, match="sensors: n004 used readings of its own sensor, which no message holds"):
        tf.replay(run, out=tmp_path / "again")
    assert not (tmp_path / "again").exists()


def test_only_reports_count_as_reports_of_a_process_with_a_sensor() -> None:
    """Its other roles may send something else, such as hellos."""
    plan = planned(paired({}, {"sends": {"hello": ["n000"]}}))
    assert [(type(flow.message).__name__, len(flow.pairs)) for flow in plan.reports] == [("Doa", 8)]


def test_counts_by_role_are_of_roles_of_the_plan_only() -> None:
    """Whatever records claim."""
    scenario = paired()
    _, ledger = lived(scenario)
    metrics = run_metrics(planned(scenario), ledger, [])
    before = metrics["frames"]["by_role"]
    assert cut_off(metrics)["frames"]["by_role"]["tally"] == dict.fromkeys(FIGURES)
    roles = {**ledger.finals["n004"]["roles"], "evil": {"delivered": 1, "ignored": 0}}
    ledger.finals["n004"] = {**ledger.finals["n004"], "roles": roles}
    ledger.finals["n000"] = {**ledger.finals["n000"], "roles": {"tally": {"delivered": 10**6, "ignored": 0}}}
    assert run_metrics(planned(scenario), ledger, [])["frames"]["by_role"] == before
    assert {name: [*one] for name, one in before.items()} == dict.fromkeys(("fusion", "node", "tally"), FIGURES)
    assert before["tally"]["delivered"] > 3


def test_without_several_roles_there_are_no_counts_by_role() -> None:
    scenario = tf.Scenario.load("zhai-spcpf", {"field.nodes": 9, "target.steps": 3})
    _, ledger = lived(scenario)
    assert run_metrics(planned(scenario), ledger, [])["frames"]["by_role"] == {}
    assert not any("roles" in record for record in ledger.finals.values())
