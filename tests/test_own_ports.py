"""Ports that an architecture gives its processes: records of devices, real ones, and what is refused of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

import trackfield as tf
from launcher.plan.architectures import ARCHITECTURES
from launcher.plan.prepare import planned
from launcher.study.compare import differences
from tests.command_line import Call, trackfield
from tests.pairs import Paired
from tests.running import SPEEDS, kept_up
from tests.strangers import Heralded
from tests.test_ports import Line
from trackfield.role import NS, Effect, Event, Ignored, PortRead, Publish, Received, Write
from trackfield.tracking.forwarding import Gathered, Gathering, Numbering
from trackfield.wire.messages import Track

__all__ = ["trackfield"]

SMALL = {"field.nodes": 9, "target.steps": 4, "architecture.kind": "own", "fusion.trackers": ["imm-ukf"]}


@dataclass(frozen=True)
class Seen:
    tracks: Gathered
    typed: int = 0


class Console:
    """Publishes the tracks that it hears, and writes each to its port with how much was typed there."""

    kinds = frozenset({"track"})

    def __init__(self, *, numbering: Mapping[str, Any]) -> None:
        self.gathering = Gathering(Numbering(**numbering), 3 * NS)

    def begin(self) -> Seen:
        return Seen(self.gathering.begin())

    def handle(self, state: Seen, event: Event) -> tuple[Seen, tuple[Effect, ...]]:
        match event:
            case PortRead(_, "tty", data):
                return replace(state, typed=state.typed * 10 + len(data)), ()
            case Received(now, Track() as message, sender):
                tracks, points = self.gathering.take(state.tracks, now, message, sender)
                state = replace(state, tracks=tracks)
                if isinstance(points, Ignored):
                    return state, (points,)
                lines = "".join(f"{one.step} {state.typed}\n" for one in points)
                moved = [replace(one, mean=(one.mean[0] + state.typed, *one.mean[1:])) for one in points]
                return state, (Write("tty", lines.encode()), *map(Publish, moved))
        return state, ()


@dataclass(frozen=True)
class WithConsole:
    """One fusion centre, and a console that hears its tracks and has these ports."""

    ports: Any

    def arrange(self, field: tf.Field) -> tf.Arranged:
        ids, place = [id for id, *_ in field.sensors], field.centre
        config = {"numbering": field.numbering}
        console = tf.Process(
            "console", "console", *place, Console, config, tags={"tracks"}, ports=self.ports
        )  # fmt: skip
        centre = field.fusion_centre("fusion", *place, ids, forwards_to="console")
        return tf.Arranged([console, centre, *field.sensor_nodes("fusion")], {"base": ["console"]})


@pytest.fixture(autouse=True)
def registry() -> Iterator[None]:
    """What a test registers is gone after it."""
    yield
    ARCHITECTURES.registered.clear()


@pytest.fixture
def line() -> Iterator[Line]:
    with closing(Line()) as line:
        yield line


def own(ports: Any, **settings: Any) -> tf.Scenario:
    tf.register_architecture("own", lambda: WithConsole(ports))
    return tf.Scenario.load("zhai-spcpf", {**SMALL, **settings})


READS = ((2_500_000_000, b"abc"), (1_500_000_000, b"xy"), (1_500_000_000, b"a"))


def test_a_record_of_a_device_is_the_same_under_both_drivers(tmp_path: Path) -> None:
    """In order of time, and at one instant as given; the console says how much was typed so far."""
    scenario = own({"tty": tf.Port(READS)})
    virtual = tf.run(scenario, out=tmp_path / "virtual")
    for speed in SPEEDS:
        real = tf.run(scenario, driver="processes", speed=speed, out=tmp_path / f"processes-{speed}")
        if kept_up(real.metrics.plain()):
            break
    assert list(differences(virtual.path, real.path, 0.0)) == []
    without = tf.run(own({}), out=tmp_path / "without")
    rows = [
        {r["step"]: r["x"] for r in run.tracks.to_pylist() if r["source"] == "console"} for run in (virtual, without)
    ]
    assert [round(rows[0][step] - rows[1][step]) for step in (1, 2, 3, 4)] == [0, 21, 213, 213]


def test_a_real_device_gets_what_was_written_and_in_virtual_time_nothing(line: Line, tmp_path: Path) -> None:
    """At the end of the run all that is held still leaves, as nothing can be undone any more."""
    scenario = own({"tty": tf.Port(READS, device=line.path, hold_ns=3 * NS)})
    tf.run(scenario, out=tmp_path / "virtual")
    assert line.read() == b""
    real = tf.run(scenario, driver="processes", out=tmp_path / "processes")
    assert real.metrics.timing.host_late == 0
    assert line.read() == b"1 0\n2 21\n3 213\n4 213\n"


def test_a_device_needs_the_speed_of_the_clock(trackfield: Call, tmp_path: Path) -> None:
    own({"tty": tf.Port(device="/dev/ttyS99")})
    settings = [word for key, value in SMALL.items() for word in ("--set", f"{key}={value}")]
    said = trackfield("run", "zhai-spcpf", *settings, "--speed", "5")
    assert said.code == 2
    assert said.err.count("\n") == 1
    message = (
        "--speed: is 5, and port tty of console has the device '/dev/ttyS99'; expected 1, or a port without a device"
    )
    assert message in said.err
    assert not list(tmp_path.iterdir())
    assert trackfield("run", "zhai-spcpf", *settings, "--virtual", "--quiet", "--out", "virtual").code == 0


def test_each_role_of_a_process_has_ports_of_its_own() -> None:
    ports = {"node/tty": tf.Port(((NS, b"x"),)), "fusion/tty": tf.Port()}
    tf.register_architecture("own", lambda: Paired(changes={"ports": ports}))
    plan = planned(tf.Scenario.load("zhai-spcpf", {**SMALL, "clock.offset_ms": 10}))
    (head,) = [process for process in plan.processes if process.role == "head"]
    assert head.ports == ports
    assert all(not process.ports for process in plan.processes if process is not head)


PORT = tf.Port()
TIMES = "expected (t, bytes), with whole nanoseconds t from 0 since the start of the run"
WRONG: dict[str, tuple[Any, str]] = {
    "none": (None, "herald.ports: is None; expected a dict of a tf.Port for each port by its name"),
    "list": ([PORT], "herald.ports: is [Port("),
    "no port": ({"tty": "/dev/ttyS0"}, "herald.ports: is {'tty': '/dev/ttyS0'}; expected a dict of a tf.Port for each"),
    "name": ({"a b": PORT}, "herald.ports: the name of a port is 'a b'; expected 1 to 32 characters of A-Z"),
    "number": ({3: PORT}, "herald.ports: the name of a port is 3; expected 1 to 32 characters"),
    "no role": ({"node/tty": PORT}, "herald.ports: the name of a port is 'node/tty'; expected 1 to 32 characters"),
    "time": ({"tty": tf.Port(((-1, b"x"),))}, f"herald.ports.tty.reads: has (-1, b'x'); {TIMES}"),
    "seconds": ({"tty": tf.Port(((1.5, b"x"),))}, f"herald.ports.tty.reads: has (1.5, b'x'); {TIMES}"),  # type: ignore[arg-type]
    "text": ({"tty": tf.Port(((1, "x"),))}, f"herald.ports.tty.reads: has (1, 'x'); {TIMES}"),  # type: ignore[arg-type]
    "triple": ({"tty": tf.Port(((1, b"x", 2),))}, f"herald.ports.tty.reads: has (1, b'x', 2); {TIMES}"),  # type: ignore[arg-type]
    "no reads": ({"tty": tf.Port(b"x")}, f"herald.ports.tty.reads: has b'x'; {TIMES}"),  # type: ignore[arg-type]
    "device": ({"tty": tf.Port(device=3)}, "herald.ports.tty.device: is 3; expected the path of a device, or ''"),  # type: ignore[arg-type]
    "control": ({"tty": tf.Port(device="a\0b")}, "herald.ports.tty.device: is 'a\\x00b'; expected the path"),
    "hold": ({"tty": tf.Port(hold_ns=-1)}, "herald.ports.tty.hold_ns: is -1; expected whole nanoseconds of wall time"),
    "baud": ({"tty": tf.Port(baud=0)}, "herald.ports.tty.baud: is 0; expected bits per second, a whole number from 50"),
    "terminal": ({"tty": tf.Port(terminal=1)}, "herald.ports.tty.terminal: is 1; expected True or False, and"),  # type: ignore[arg-type]
    "terminal and device": ({"tty": tf.Port(terminal=True, device="/dev/x")}, "herald.ports.tty.terminal: is"),
    "terminals": (
        {name: tf.Port(terminal=True) for name in ("a", "b")},
        "herald.ports: has several terminals; expected one of a process at most: it is named after the process",
    ),
    "too much": ({"tty": tf.Port(((0, bytes(2**24)), (1, b"x")))}, "herald.ports: 16777217 bytes come in there; exp"),
}  # fmt: skip


def changed(ports: Any) -> Any:
    @dataclass(frozen=True)
    class Changed:
        def arrange(self, field: tf.Field) -> tf.Arranged:
            arranged = Heralded().arrange(field)
            herald, *others = arranged.processes
            return replace(arranged, processes=[replace(herald, ports=ports), *others])

    return Changed


@pytest.mark.parametrize("name", WRONG)
def test_ports_that_cannot_be_are_refused_with_one_message(name: str) -> None:
    ports, message = WRONG[name]
    tf.register_architecture("own", changed(ports))
    with pytest.raises(tf.ScenarioError) as caught:
        tf.run(tf.Scenario.load("zhai-spcpf", SMALL), out="runs/never/")
    assert f"architecture 'own': {message}" in str(caught.value)
    assert len(caught.value.parts) == 1


@pytest.mark.parametrize("name", ["tty", "nobody/tty", "node/", "node/a b"])
def test_a_port_belongs_to_one_of_several_roles(name: str) -> None:
    tf.register_architecture("own", lambda: Paired(changes={"ports": {name: PORT}}))
    with pytest.raises(tf.ScenarioError) as caught:
        planned(tf.Scenario.load("zhai-spcpf", SMALL))
    assert f".ports: the name of a port is '{name}'; expected " in str(caught.value)
