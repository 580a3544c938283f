"""Architectures that users bring: what is wrong with them is said at once, and what is right works like our own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

import trackfield as tf
from launcher.plan.architectures import ARCHITECTURES
from launcher.plan.extensions import check_importable
from launcher.plan.forecast.foresight import foresee
from launcher.plan.prepare import planned, remarks
from launcher.report.folder import read_run
from launcher.report.outages import in_words
from launcher.study.compare import differences
from tests.command_line import Call, trackfield
from tests.running import SPEEDS, kept_up
from tests.strangers import Herald, Heralded, Merged
from trackfield.role import NS, Publish, Started, Timer, TrackPoint
from trackfield.scenario import names
from trackfield.wire.registry import kind_of

__all__ = ["trackfield"]

SMALL = {"field.nodes": 9, "target.steps": 3, "architecture.kind": "own"}


@pytest.fixture(autouse=True)
def registry() -> Any:
    """What a test registers is gone after it."""
    yield
    ARCHITECTURES.registered.clear()


def own(maker: Any, **settings: Any) -> tf.Scenario:
    """A small scenario with this architecture."""
    tf.register_architecture("own", maker)
    return tf.Scenario.load("zhai-spcpf", {**SMALL, **settings})


def built_by(arrange: Callable[[Any], Any]) -> type:
    """An architecture that arranges in this way."""

    @dataclass(frozen=True)
    class Own:
        def arrange(self, field: tf.Field) -> Any:
            return arrange(field)

    return Own


def changed(**changes: Any) -> type:
    """The architecture with a herald, with something else about its herald."""

    def arrange(field: tf.Field) -> tf.Arranged:
        arranged = Heralded().arrange(field)
        herald, *others = arranged.processes
        return replace(arranged, processes=[replace(herald, **changes), *others])

    return built_by(arrange)


def twice(field: tf.Field) -> tf.Arranged:
    arranged = Heralded().arrange(field)
    return replace(arranged, processes=[*arranged.processes, arranged.processes[-1]])


def viewed(views: Any) -> type:
    return built_by(lambda field: replace(Heralded().arrange(field), views=views))


class NoRole:
    """Takes the arguments, and is none."""

    def __init__(self, *, to: list[str]) -> None:
        pass


class NoSet(Herald):
    """A role whose kinds are a text."""

    def __init__(self, *, to: list[str]) -> None:
        super().__init__(to=to)
        self.kinds = "hello"  # type: ignore[assignment]


def raising(field: tf.Field) -> tf.Arranged:
    raise RuntimeError("no idea")


WRONG: dict[str, tuple[type, str]] = {
    "raises": (built_by(raising), "architecture 'own': arrange: RuntimeError: no idea"),
    "nothing": (built_by(lambda _: None), "arrange: returned None; expected an Arranged of processes and views"),
    "no process": (built_by(lambda _: tf.Arranged([], {"base": ["x"]})), "no process has a sensor; expected"),
    "no Process": (built_by(lambda _: tf.Arranged(["a"], {})), "'a' is among its processes; expected each a Process"),  # type: ignore[list-item]
    "twice": (built_by(twice), "n008: two processes have this id; expected an id of its own for each"),
    "reserved": (changed(id="recorder"), "recorder: this id names another process of the run; expected"),
    "form": (changed(id="a/b"), "the id of a process is 'a/b'; expected 1 to 32 characters"),
    "long": (changed(id="a" * 33), "the id of a process is 'aaa"),
    "role": (changed(role=""), "the role of a process is ''; expected 1 to 32 characters"),
    "no place": (changed(x=None), "herald.x: is None; expected metres"),
    "nowhere": (changed(y=float("nan")), "herald.y: is nan; expected metres"),
    "receiver": (changed(sends={"hello": ["fusian"]}), "there is no other process 'fusian'; did you mean fusion?"),
    "itself": (changed(sends={"hello": ["herald"]}), "herald.sends: there is no other process 'herald'"),
    "text": (changed(sends={"hello": "fusion"}), "herald.sends: is 'fusion'; expected a list of names, each"),
    "message": (changed(sends={"helo": ["fusion"]}), "architecture 'own': herald.sends: there is no message 'helo'"),
    "kind": (changed(sends={3: ["fusion"]}), "herald.sends: is {3: ['fusion']}; expected lists of ids by the kind of"),
    "listed": (changed(sends={"hello": [["fusion"]]}), "herald.sends: there is no other process ['fusion']; expected"),
    "config": (changed(config=None), "herald.config: is None; expected a dict of its role's arguments by name"),
    "list": (changed(config=[1]), "herald.config: is [1]; expected a dict of its role's arguments by name"),
    "two clocks": (changed(asks=["fusion"]), "herald.asks: there is no other process ['fusion']; expected one of"),
    "no set": (changed(factory=NoSet), "the kinds of what tests.test_own_architectures:NoSet makes are 'hello'; exp"),
    "empty battery": (changed(battery_j=1e-7, tags=["battery"]), "herald.battery_j: is 1e-07; expected joules from"),
    "dam": (changed(battery_j=2e9, tags=["battery"]), "herald.battery_j: is 2000000000.0; expected joules from 1e-06"),
    "far": (changed(route=[(0, 0.0, 0.0), (9, 1e9, 0.0)]), "herald.route: leads to (1000000000.0, 0.0); expected at"),
    "elsewhere": (changed(route=[(0, 3.0, 0.0)]), "herald.route: begins at (3.0, 0.0); expected its x and y, ("),
    "fuses list": (changed(fuses=[["n001"]]), "herald.fuses: there is no sensor ['n001']; expected one of n000"),
    "fuses twice": (changed(fuses=["n001", "n001"]), "herald.fuses: 'n001' is there twice; expected each of them"),
    "seen twice": (viewed({"base": ["fusion", "fusion"]}), "views.base: 'fusion' is there twice; expected each of"),
    "seen list": (viewed({"base": [["fusion"]]}), "views.base: there is no process ['fusion']; expected one of"),
    "a medium to ask by": (
        changed(asks="fusion", asks_over="backbone", media=["field", "backbone"]),
        "herald.asks_over: is 'backbone', which fusion does not have; expected a medium that both ends have (media)",
    ),
    "no medium": (changed(asks="fusion", asks_over=7), "herald.asks_over: is 7, which herald does not have"),
    "ways": (changed(carries=["fusion"]), "herald.carries: is ['fusion']; expected a dict of arguments by name"),
    "orders": (changed(managed={1: 2}), "herald.managed: is {1: 2}; expected a dict of arguments by name"),
    "clock": (changed(asks="nobody"), "herald.asks: there is no other process 'nobody'; expected one of herald"),
    "circle": (changed(asks="fusion"), "herald asks fusion asks herald for the time, so none of them ever learns it"),
    "tag": (changed(tags={"track"}), "there is no tag 'track'; did you mean tracks?; expected one of tracks, bat"),
    "battery": (changed(battery_j=3.0), "herald.battery_j: is given without the tag 'battery'; expected both"),
    "sensor": (changed(senses=True), "the sensor herald is not in this field; expected the id and place of one"),
    "fuses": (changed(fuses=["n099"]), "herald.fuses: there is no sensor 'n099'; expected one of n000, n001, "),
    "route": (changed(route=[(5, 0.0, 0.0), (5, 1.0, 1.0)]), "herald.route: is [(5, 0.0, 0.0), (5, 1.0, 1.0)]; exp"),
    "no view": (viewed({}), "views: there is none; expected at least one: the headline, such as {'base': ['fusion']}"),
    "empty": (viewed({"base": []}), "views.base: is empty; expected the id of at least one process that tracks"),
    "stranger": (viewed({"base": ["hq"]}), "views.base: there is no process 'hq'; expected one of herald, fusion"),
    "silent": (viewed({"base": ["herald"]}), "views.base: herald publishes no tracks; expected processes with the"),
    "missing": (changed(factory="strangers:Herald"), "herald.factory: cannot be loaded from strangers:Herald (Modu"),
    "number": (changed(factory=3), "herald.factory: is 3; expected a class, or module:attribute"),
    "no role": (changed(factory=NoRole), "makes has no kinds, begin, handle; expected a role: with"),
    "argument": (changed(config={"at": 3}), "makes no role of these arguments (TypeError: Herald.__init__() got"),
    "unsendable": (changed(config={"to": {1, 2}}), "herald.config: cannot be sent to it (can not serialize 'set'"),
    "unknown role": (changed(factory=""), "no installed package offers the role 'herald'; expected a Process with"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_what_cannot_be_is_refused_with_one_message(name: str) -> None:
    maker, message = WRONG[name]
    with pytest.raises(tf.ScenarioError) as caught:
        tf.run(own(maker), out="runs/never/")
    assert message in str(caught.value)
    assert len(caught.value.parts) == 1


def test_too_many_processes_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("launcher.plan.architectures.checks.MOST_NODES", 10)
    with pytest.raises(tf.ScenarioError, match="returned 11 processes; expected at most 10"):
        planned(own(Heralded))


def test_what_is_given_as_generators_is_used() -> None:
    """A generator can be read only once."""

    def arrange(field: tf.Field) -> tf.Arranged:
        arranged = Heralded().arrange(field)
        herald, centre, *nodes = arranged.processes
        herald = replace(herald, sends={"hello": (id for id in ["fusion", "n001"])})
        fuses = (id for id, *_ in field.sensors)
        centre = replace(centre, fuses=fuses, tags=(tag for tag in ["tracks", "battery"]), battery_j=3.0)
        return tf.Arranged((one for one in [herald, centre, *nodes]), {"base": (id for id in ["fusion"])})

    plan = planned(own(built_by(arrange)))
    assert [len(flow.pairs) for flow in plan.flows if kind_of(flow.message).name == "hello"] == [2]
    assert plan.views[0].sources == ("fusion",)
    assert plan.info.places[1].tags == {"tracks", "battery"}
    assert len(plan.tracking["sensors"]) == 9


def test_a_radio_may_acknowledge_messages_of_ones_own() -> None:
    plan = planned(own(Heralded, **{"link.model": "lognormal_prr", "link.acks": {"hello": 2}}))
    assert plan.run.link["acks"] == {"hello": 2}
    with pytest.raises(tf.ScenarioError, match=r"link\.acks: there is no message 'helo'; did you mean hello"):
        planned(own(Heralded, **{"link.model": "lognormal_prr", "link.acks": {"helo": 2}}))


def test_a_centre_needs_sensors() -> None:
    maker = built_by(lambda field: tf.Arranged([field.fusion_centre("a", 0.0, 0.0, [])], {"base": ["a"]}))
    with pytest.raises(tf.ScenarioError, match="fusion centre 'a': would fuse the reports of no sensor; expected"):
        planned(own(maker))


def test_options_and_names_are_checked(trackfield: Call) -> None:
    tf.register_architecture("heralded", Heralded)
    small = ("validate", "zhai-spcpf", "--set", "field.nodes=9", "--set")
    for setting, said in (
        (("architecture.kind=heralde",), "architecture.kind: unknown architecture 'heralde'; expected 'heralded'"),
        (("architecture.kind=heralded", "architecture.heral=hq"), "architecture.heral: unknown option; did you mean"),
        (("architecture.kind=heralded", "architecture.herald=3"), "architecture.herald: is 3; expected a text"),
        (("architecture.kind=heralded", "architecture.herald=n001"), "architecture 'heralded': n001: two processes"),
        (("architecture.kind=heralded", "faults=[{kind='kill',role='head',at_s=1}]"), "one of herald, fusion, node"),
    ):
        done = trackfield(*small, *" --set ".join(setting).split(" "))
        assert (done.code, said in done.err) == (2, True), done.err
    assert trackfield(*small, "architecture.kind=heralded", "--set", "architecture.herald=hq").code == 0
    listed = trackfield("list", "architectures").out
    assert "One centre, and a herald that tells the time to all and says hello to the centre" in listed
    assert "(tests.strangers:Heralded)" in listed


def test_our_own_names_are_taken() -> None:
    with pytest.raises(tf.ScenarioError, match="'centralised' is an architecture of Trackfield's own"):
        tf.register_architecture("centralised", Heralded)
    with pytest.raises(tf.ScenarioError, match="architecture 'mine' has no arrange"):
        tf.register_architecture("mine", int)


def test_the_launcher_adds_what_every_process_needs() -> None:
    plan = planned(own(Heralded, **{"clock.offset_ms": 10, "energy.battery_j": 5.0}))
    herald, centre, node, *_ = plan.processes
    assert [kind_of(flow.message).name for flow in plan.flows] == ["doa", "sync-request", "sync-reply", "hello"]
    assert herald.clock == {}
    assert centre.clock
    assert centre.config["sync"]["reference"] == node.config["sync"]["reference"] == "herald"
    assert (node.power["battery_fj"], herald.power["battery_fj"]) == (5 * 10**15, None)
    assert set(herald.peers) == {"fusion", *(place.id for place in plan.info.places if place.role == "node")}
    assert set(node.peers) == {"fusion", "herald"}
    assert remarks(plan) == []


@pytest.mark.parametrize("architecture", ["centralised", "own"])
@pytest.mark.parametrize("name", names())
def test_each_packaged_field_runs_with_defaults(name: str, architecture: str, tmp_path: Path) -> None:
    tf.register_architecture("own", Heralded)
    passes = name == "yang-ecpa"  # a track is expected once the first of them are reported
    alone = {"sensor.waveform": False, "camera.kind": "none"}  # they have no gateway to a camera
    steps = {"target.steps": 32, **alone} if passes else {"target.steps": 3}
    scenario = tf.Scenario.load(name, {"architecture.kind": architecture, **steps})
    result = tf.run(scenario, out=tmp_path / "run")
    expected = planned(scenario).pass_steps if passes else range(3)
    assert expected
    assert {one.steps_expected for one in result.metrics.trackers.values()} == {len(expected)}


def test_a_role_of_ones_own_is_the_same_over_processes(tmp_path: Path) -> None:
    """With a message of its own, faults by its role, and the time told by it."""
    faults = [{"kind": "restart", "role": "herald", "at_s": 2, "until_s": 4}]
    settings = {"target.steps": 6, "clock.offset_ms": 10, "link.model": "lognormal_prr", "faults": faults}
    scenario = own(Heralded, **settings)
    virtual = tf.run(scenario, out=tmp_path / "virtual")
    for speed in SPEEDS:
        real = tf.run(scenario, driver="processes", speed=speed, out=tmp_path / f"processes-{speed}")
        if kept_up(real.metrics.plain()):
            break
    assert list(differences(virtual.path, real.path, 0.0)) == []
    said = [row for row in real.messages.to_pylist() if row["kind"] == "hello"]
    assert {row["text"] for row in said} >= {"Hello(number=0)", "Hello(number=1)"}
    assert [row["text"] for row in virtual.messages.to_pylist() if row["kind"] == "hello"] == [r["text"] for r in said]


def test_a_role_within_a_function_works_in_virtual_time_only(tmp_path: Path) -> None:
    class Local(Herald):
        pass

    scenario = own(changed(factory=Local))
    assert tf.run(scenario, out=tmp_path / "virtual").metrics.frames.by_kind["hello"].sent > 2
    with pytest.raises(tf.ScenarioError, match=r"role 'herald': is defined in a function .*, where other processes"):
        tf.run(scenario, driver="processes", out=tmp_path / "processes")
    assert not (tmp_path / "processes").exists()
    check_importable(planned(own(Heralded)))


def halved(field: tf.Field) -> tf.Arranged:
    """Two centres with half of the sensors each, and nobody who gathers their tracks."""
    ids = [id for id, *_ in field.sensors]
    processes: list[tf.Process] = []
    for number, half in enumerate((ids[::2], ids[1::2])):
        processes.append(field.fusion_centre(f"c{number}", *field.centre, half))
        processes += field.sensor_nodes(f"c{number}", half)
    return tf.Arranged(processes, {"both": ["c0", "c1"]})


def test_what_is_foreseen_goes_by_who_gets_the_reports() -> None:
    """Reports that are divided among centres give a fix less often than the same ones at a single centre."""
    link = {"link.model": "fixed", "link.loss": 0.5, "target.steps": 20}
    one, two = (
        foresee(planned(tf.Scenario.load("zhai-spcpf", {**link, "architecture.kind": kind})))
        for kind in ("centralised", registered(halved))
    )
    assert one.reports == two.reports
    assert one.arriving == two.arriving == pytest.approx(0.5)
    assert (one.coverage[0].in_reach == two.coverage[0].in_reach).all()
    assert 0.1 < two.coverage[0].fixed.mean() < one.coverage[0].fixed.mean() - 0.1


def registered(arrange: Callable[[Any], Any]) -> str:
    tf.register_architecture("own", built_by(arrange))
    return "own"


def test_those_that_fuse_have_their_own_sensors_priors_and_draws() -> None:
    plan = planned(tf.Scenario.load("zhai-spcpf", {"architecture.kind": registered(halved)}))
    first, second = (process for process in plan.processes if process.role == "fusion")
    assert [place[0] for place in first.config["sensors"][:3]] == ["n000", "n002", "n004"]
    assert [place[0] for place in second.config["sensors"][:3]] == ["n001", "n003", "n005"]
    assert first.config["prior"] != second.config["prior"]
    assert ("draws" in first.config, second.config["draws"]) == (False, ["c1"])
    for process in (first, second):
        assert plan.bank_of(process.id).items() <= process.config.items()


def test_the_report_says_why_there_was_no_track(tmp_path: Path) -> None:
    """One of two centres that is down explains nothing by itself; both do."""
    faults = [{"kind": "kill", "nodes": ["c0"], "at_s": 4}, {"kind": "kill", "nodes": ["c1"], "at_s": 8}]
    settings = {
        "architecture.kind": registered(halved),
        "target.steps": 12,
        "faults": faults,
        "fusion.trackers": ["ekf"],
    }
    found = read_run(tf.run(tf.Scenario.load("zhai-spcpf", settings), out=tmp_path / "run").path)
    assert in_words(found, found.tracks[0]) == "5 s without a track: c0 was killed at 4 s; c1 was killed at 8 s."


def test_a_role_sends_to_those_that_its_architecture_names(tmp_path: Path) -> None:
    """Over processes the recorder refuses such a frame, and the run fails, too."""
    scenario = own(changed(config={"to": ["fusion", "n001"]}))
    with pytest.raises(tf.RunFailed, match="herald sent hello to n001, to which it sends nothing by the plan"):
        tf.run(scenario, out=tmp_path / "virtual")
    with pytest.raises(tf.RunFailed, match="3 frames never reached the recorder"):
        tf.run(scenario, driver="processes", speed=2.0, out=tmp_path / "processes")


def test_a_run_in_which_a_role_made_tracks_in_its_own_way_is_not_replayed(tmp_path: Path) -> None:
    run = tf.run(own(Merged), out=tmp_path / "run")
    assert {row["source"] for row in run.tracks.to_pylist()} == {"a", "b", "base"}
    with pytest.raises(tf.ScenarioError, match="source: base made tracks in a way of its own, which a replay cannot"):
        tf.replay(run, out=tmp_path / "again")
    assert not (tmp_path / "again").exists()


POINT = TrackPoint("spcpf", "target", 5 * NS, "tracking", (1.0, 2.0, 3.0, 4.0), (1.0,) * 16, step=5)
STRAYS: dict[str, tuple[Any, frozenset[str], str]] = {
    "tracker": (replace(POINT, tracker="other"), frozenset({"tracks"}), "herald published points of 'other'"),
    "tag": (POINT, frozenset(), "herald published points without the tag 'tracks' (1 times)"),
}  # fmt: skip


class Stray(Herald):
    """A herald that publishes a point as it starts."""

    def __init__(self, *, case: str) -> None:
        super().__init__(to=["fusion"])
        self.case = case

    def handle(self, state: Any, event: Any) -> tuple[Any, tuple[Any, ...]]:
        after, effects = super().handle(state, event)
        if isinstance(event, Started):
            return after, (*effects, Publish(STRAYS[self.case][0]))
        return after, effects


@pytest.mark.parametrize("driver", ["virtual", "processes"])
@pytest.mark.parametrize("case", STRAYS)
def test_points_that_belong_to_no_track_fail_the_run(case: str, driver: Any, tmp_path: Path) -> None:
    _, tags, said = STRAYS[case]
    scenario = own(changed(factory=Stray, config={"case": case}, tags=tags))
    with pytest.raises(tf.RunFailed) as caught:
        tf.run(scenario, driver=driver, speed=4.0 if driver == "processes" else None, out=tmp_path / "run")
    assert said in str(caught.value)
    run = tf.open(tmp_path / "run")
    assert {row["source"] for row in run.tracks.to_pylist()} == {"fusion"}
    assert run.report().is_file()


class Faulty(Herald):
    """A herald that does something wrong after a second."""

    def __init__(self, *, case: str) -> None:
        super().__init__(to=["fusion"])
        self.case = case

    def handle(self, state: Any, event: Any) -> tuple[Any, tuple[Any, ...]]:
        if not isinstance(event, Timer):
            return super().handle(state, event)
        if self.case == "raises":
            raise KeyError("mine")
        return state, {"shape": (Publish(replace(POINT, mean=(1.0, 2.0))),), "effect": ("x",)}[self.case]


@pytest.mark.parametrize(
    ("case", "said"),
    [
        ("raises", r"KeyError: 'mine' \(test_own_architectures.py, line \d+\)"),
        ("shape", "ValueError: a point of a track has no state of x, y, vx, vy"),
        ("effect", "TypeError: 'x' is no effect"),
    ],
)
def test_a_role_that_fails_is_told_with_its_process_and_time(case: str, said: str, tmp_path: Path) -> None:
    scenario = own(changed(factory=Faulty, config={"case": case}))
    told = rf"herald \(role herald\) failed 1\.000 s after the start of the run: {said}"
    with pytest.raises(tf.RunFailed, match=told) as caught:
        tf.run(scenario, out=tmp_path / "run")
    assert caught.value.process == "herald"
