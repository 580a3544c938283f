"""A bridge as a role, and as what takes the place of a process in a plan."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from errno import EACCES
from pathlib import Path
from typing import Any

import pytest
from serial import Serial

import trackfield as tf
from launcher.plan.architectures import ARCHITECTURES
from launcher.plan.bridges import bridged
from launcher.plan.prepare import planned
from launcher.record.folder import keep, write_manifest
from launcher.records import Plan
from launcher.study import recover
from tests.bridged import Answer, Lined, Question
from tests.command_line import Call, trackfield
from tests.test_ports import Line
from trackfield.drivers.ports import Port
from trackfield.protocols.bridge import Bridge, Heard
from trackfield.role import NS, Effect, Ignored, Note, PortRead, Radio, Received, Send, SetTimer, Started, Timer, Write
from trackfield.wire import encode, line

__all__ = ["trackfield"]

SMALL = {"field.nodes": 9, "target.steps": 4, "architecture.kind": "own", "fusion.trackers": ["imm-ukf"]}
BRIDGE = Bridge(peer="desk", kinds=["question"], modules=["tests.bridged"])
NOISE = b"\x07noise\0"


def line_of(message: object) -> bytes:
    return line.framed(encode(message))


def heard(*data: bytes, state: Heard = Heard(), now: int = 0) -> tuple[Heard, list[Effect]]:  # noqa: B008
    """The state after these bytes came, and all effects."""
    effects: list[Effect] = []
    for one in data:
        state, more = BRIDGE.handle(state, PortRead(now, "line", one))
        effects += more
    return state, effects


# --- the role ---------------------------------------------------------------------------------------------------------


def test_it_begins_with_nothing() -> None:
    assert BRIDGE.handle(BRIDGE.begin(), Started(0, b"")) == (Heard(), ())
    assert BRIDGE.kinds == {"question"}


def test_a_message_to_it_is_a_line_with_the_payload_of_its_frame() -> None:
    _, (wrote,) = BRIDGE.handle(Heard(), Received(5, Question(300), "desk"))
    assert isinstance(wrote, Write)
    assert wrote.port == "line"
    assert line.unframed(wrote.data[:-1]) == encode(Question(300))


def test_what_others_than_its_peer_send_is_no_matter_of_the_line() -> None:
    assert BRIDGE.handle(Heard(), Received(5, Question(300), "fusion")) == (Heard(), (Ignored("unexpected"),))


def test_a_line_from_the_device_is_a_message_to_its_peer() -> None:
    data = line_of(Answer(1)) + line_of(Answer(2))
    sent = [Send(Answer(number), "desk", "serial") for number in (1, 2)]
    assert heard(data) == (Heard(), sent)
    assert heard(*(bytes([one]) for one in data)) == (Heard(), sent)


@pytest.mark.parametrize(
    ("bad", "why"),
    [
        (NOISE, "line: its codes do not fit its bytes"),
        (line_of(Answer(1))[:3] + b"\x09" + line_of(Answer(1))[4:], "line: its check sum is wrong"),
        (line.framed(b"nothing"), "malformed: "),
        (line.framed(b"\x93\x01\xcc\xfe\x01"), "kind: 254"),
        (line.framed(b""), "malformed: "),
        (b"\x01" * (line.MOST_BYTES + 9) + b"\0", "line: more than 4115 bytes"),
    ],
)
def test_a_line_that_carries_no_message_is_dropped_and_told_later(bad: bytes, why: str) -> None:
    """The messages before and after it pass; what was dropped within a second is told once."""
    state, effects = heard(line_of(Answer(1)) + bad + line_of(Answer(2)), bad, now=7)
    assert effects == [
        Send(Answer(1), "desk", "serial"),
        Send(Answer(2), "desk", "serial"),
        SetTimer("dropped", 7 + NS),
    ]
    assert state.dropped == 2
    state, (note,) = BRIDGE.handle(state, Timer(7 + NS, "dropped"))
    assert isinstance(note, Note)
    assert note.text.startswith(f"2 lines from the device dropped, the last of them: {why}")
    assert state == Heard()
    assert heard(NOISE, state=state, now=9)[1] == [SetTimer("dropped", 9 + NS)]


def test_a_line_goes_on_while_dropped_ones_are_told() -> None:
    state, _ = heard(NOISE + line_of(Answer(1))[:4])
    state, _ = BRIDGE.handle(state, Timer(NS, "dropped"))
    assert heard(line_of(Answer(1))[4:], state=state) == (Heard(), [Send(Answer(1), "desk", "serial")])


# --- the plan ---------------------------------------------------------------------------------------------------------


@pytest.fixture(autouse=True)
def registry() -> Iterator[None]:
    """What a test registers is gone after it."""
    yield
    ARCHITECTURES.registered.clear()


@pytest.fixture
def device() -> Iterator[Line]:
    with closing(Line()) as device:
        yield device


def plan(lined: Lined = Lined(), **settings: Any) -> Plan:  # noqa: B008
    tf.register_architecture("own", lambda: lined)
    return planned(tf.Scenario.load("zhai-spcpf", {**SMALL, **settings}))


def test_a_bridge_has_the_line_of_the_process_and_its_messages() -> None:
    before = plan(**{"serial.baud": 9600})
    after = bridged(before, {"gauge": "/dev/ttyUSB0"})
    gauge = next(one for one in after.processes if one.id == "gauge")
    assert gauge.factory == "trackfield.protocols.bridge:Bridge"
    assert gauge.config == {"peer": "desk", "kinds": ["question"], "modules": ["tests.bridged"], "silent": []}
    assert gauge.ports == {"line": Port(device="/dev/ttyUSB0", baud=9600)}
    assert after.bridges == {"gauge": "/dev/ttyUSB0"}
    assert [one for one in after.processes if one.id != "gauge"] == [o for o in before.processes if o.id != "gauge"]
    assert after.warnings == before.warnings


def test_each_life_of_the_process_is_a_bridge() -> None:
    faults = [{"kind": "restart", "nodes": ["gauge"], "at_s": 1, "until_s": 3}]
    after = bridged(plan(faults=faults), {"gauge": "pty"})
    lives = [one for one in after.processes if one.id == "gauge"]
    assert [life.incarnation for life in lives] == [0, 1]
    assert lives[0].config == lives[1].config


def test_other_media_of_the_process_are_silent_and_that_is_said() -> None:
    after = bridged(plan(Lined(gauge=("field", "backbone", "serial"))), {"gauge": "pty"})
    said = "a real device is in the place of gauge: nothing is sent or heard there by field, backbone"
    assert said in after.warnings
    gauge = next(one for one in after.processes if one.id == "gauge")
    assert gauge.config["silent"] == ["field", "backbone"]
    bridge = Bridge(**gauge.config)
    assert bridge.handle(bridge.begin(), Started(0)) == (Heard(), (Radio(False, "field"), Radio(False, "backbone")))


def test_tracks_that_a_device_cannot_publish_are_said_to_be_missing() -> None:
    whole = plan()
    places = tuple(replace(p, tags=frozenset({"tracks"})) if p.id == "gauge" else p for p in whole.info.places)
    after = bridged(replace(whole, info=replace(whole.info, places=places)), {"gauge": "pty"})
    assert "a real device is in the place of gauge: the tracks that gauge publishes are missing" in after.warnings


# --- the command line -------------------------------------------------------------------------------------------------

WIRED = "expected one of desk, gauge, hub, lonely, one, two"
WRONG: dict[str, tuple[tuple[str, ...], str]] = {
    "no device": (("gauge",), "is 'gauge'; expected ID=DEVICE, like base=/dev/ttyUSB0, or ID=pty"),
    "empty": (("gauge=",), "is 'gauge='; expected ID=DEVICE"),
    "control": (("gauge=/dev/tty\x07",), "is 'gauge=/dev/tty\\x07'; expected ID=DEVICE"),
    "twice": (("gauge=pty", "gauge=/dev/ttyUSB0"), "gauge is there twice; expected one device for each process"),
    "shared": (("gauge=/dev/ttyUSB0", "desk=/dev/ttyUSB0"), "/dev/ttyUSB0 is there twice; expected a device of its"),
    "unknown": (("gage=pty",), f"there is no process 'gage'; did you mean gauge?; {WIRED}"),
    "radio": (("fusion=pty",), f"fusion has no serial line, only field; {WIRED}"),
    "several": (("hub=pty",), "the line of hub leads to one, two; expected a line to one other process: a device"),
    "nobody": (("lonely=pty",), "nothing goes by the line of lonely; expected a line to one other process: a device"),
    "file": (("gauge=file",), "file is not a terminal; expected a serial device, or pty"),
    "folder": (("gauge=.",), ". cannot be opened (Is a directory); expected a serial device to read and write"),
    "device": (("gauge=/dev/null",), "/dev/null is not a terminal; expected a serial device, or pty"),
}  # fmt: skip
OPTIONS: dict[str, tuple[tuple[str, ...], str]] = {
    "virtual": (("--virtual",), "there is no device in virtual time; expected it without --virtual"),
    "external": (("--external", "--connect", "tcp/127.0.0.1:1"), "the processes start elsewhere; expected it without"),
    "speed": (("--speed", "2"), "a device goes by the wall clock; expected it with --speed 1"),
}
Ask = Callable[..., Any]


@pytest.fixture
def ask(trackfield: Call, tmp_path: Path) -> Ask:
    """``validate`` of the field with these bridges."""

    def call(*bridges: str, options: tuple[str, ...] = ()) -> Any:
        tf.register_architecture("own", Lined)
        settings = [word for key, value in SMALL.items() for word in ("--set", f"{key}={value}")]
        asked = [word for one in bridges for word in ("--bridge", one)]
        return trackfield("validate", "zhai-spcpf", *settings, *asked, *options)

    return call


@pytest.mark.parametrize("name", WRONG)
def test_bridges_that_cannot_be_are_refused_with_one_message(name: str, ask: Ask, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    bridges, message = WRONG[name]
    said = ask(*bridges)
    assert said.code == 2
    assert said.err.startswith(f"trackfield: --bridge: {message}")
    assert said.err.count("\n") == 1


@pytest.mark.parametrize("name", OPTIONS)
def test_a_device_needs_processes_of_the_launcher_at_its_speed(name: str, ask: Ask) -> None:
    options, message = OPTIONS[name]
    said = ask("gauge=pty", options=options)
    assert (said.code, said.err.count("\n")) == (2, 1)
    assert f"--bridge: {message}" in said.err


def test_a_device_that_may_not_be_opened_is_refused(ask: Ask, device: Line, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever runs the test, who may be allowed everything."""
    opened = os.open

    def forbidden(path: Any, *given: Any, **more: Any) -> int:
        if path == device.path:
            raise PermissionError(EACCES, os.strerror(EACCES))
        return opened(path, *given, **more)

    monkeypatch.setattr(os, "open", forbidden)
    said = ask(f"gauge={device.path}")
    assert (said.code, said.err.count("\n")) == (2, 1)
    assert f"--bridge: {device.path} cannot be opened (Permission denied); expected a serial device" in said.err


def test_a_device_that_another_process_has_is_refused(ask: Ask, device: Line) -> None:
    with Serial(device.path, exclusive=True):
        said = ask(f"gauge={device.path}")
    assert (said.code, said.err.count("\n")) == (2, 1)
    assert f"--bridge: {device.path} is in use by another process; expected a device that is free" in said.err
    assert ask(f"gauge={device.path}").code == 0


def test_a_device_that_is_not_there_yet_is_a_warning(ask: Ask, device: Line) -> None:
    said = ask("gauge=/dev/ttyUSB77")
    assert said.code == 0
    message = "/dev/ttyUSB77 is not there yet, and waited for: what is sent to gauge meanwhile is lost"
    assert f"warning: {message}" in said.err
    assert "waited for" not in ask(f"gauge={device.path}").err


# --- Python, and afterwards -------------------------------------------------------------------------------------------

ARGUMENTS: dict[str, tuple[dict[str, Any], str]] = {
    "virtual": ({"bridge": {"gauge": "pty"}}, "bridge: a device goes by the wall clock; expected driver="),
    "speed": ({"bridge": {"gauge": "pty"}, "driver": "processes", "speed": 2}, "bridge: a device goes by the wall clo"),
    "list": ({"bridge": ["gauge=pty"], "driver": "processes"}, "bridge: is ['gauge=pty']; expected a dict of devices"),
    "path": ({"bridge": {"gauge": Path("tty")}, "driver": "processes"}, "bridge: is {'gauge': PosixPath('tty')}; exp"),
    "unknown": ({"bridge": {"gage": "pty"}, "driver": "processes"}, "bridge: there is no process 'gage'; did you mean"),
}  # fmt: skip


@pytest.mark.parametrize("name", ARGUMENTS)
def test_from_python_the_same_is_refused(name: str, tmp_path: Path) -> None:
    tf.register_architecture("own", Lined)
    arguments, message = ARGUMENTS[name]
    with pytest.raises(tf.ScenarioError) as caught:
        tf.run(tf.Scenario.load("zhai-spcpf", SMALL), out=tmp_path / "out", **arguments)
    assert str(caught.value).startswith(message)
    assert not (tmp_path / "out").exists()


def test_a_run_that_was_cut_off_is_recovered_with_its_devices(tmp_path: Path) -> None:
    """What is made of its log is by the plan that ran."""
    tf.register_architecture("own", Lined)
    scenario = tf.Scenario.load("zhai-spcpf", SMALL)
    ran = bridged(planned(scenario), {"gauge": "/dev/ttyUSB0"})
    keep(scenario, tmp_path)
    write_manifest(tmp_path, ran, [], None)
    again = recover._planned(tmp_path)
    assert (again.processes, again.bridges, again.run) == (ran.processes, ran.bridges, ran.run)
