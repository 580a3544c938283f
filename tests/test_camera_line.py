"""A camera at the other end of a real line: ours, at a terminal, in the place of the one that the run emulates."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

import trackfield as tf
from launcher.plan.architectures import ARCHITECTURES
from launcher.plan.bridges import BARE_HOLD_NS, bridged
from launcher.plan.prepare import planned
from tests.bridged import Question
from tests.cameras import Served, most_in_order
from tests.command_line import Call, trackfield
from tests.running import PATIENCE_S, until
from tests.test_bridge import SMALL
from tests.test_bridged_runs import Plug
from tests.watched import Watched, said
from trackfield.drivers.ports import Port
from trackfield.protocols.bridge import TELL_NS, Bridge, Heard
from trackfield.role import Effect, Ignored, Note, PortRead, Received, Send, SetTimer, Timer, Write
from trackfield.wire import decode, visca
from trackfield.wire.outside import Visca

__all__ = ["trackfield"]

BRIDGE = Bridge(peer="desk", kinds=["visca"], bare=True)
HOME = visca.command_packet(visca.Home())
ACK = visca.reply_packet(visca.Ack(1))


def read(*data: bytes, state: Heard = Heard(), now: int = 0) -> tuple[Heard, list[Effect]]:  # noqa: B008
    """The state after these bytes came, and all effects."""
    effects: list[Effect] = []
    for one in data:
        state, more = BRIDGE.handle(state, PortRead(now, "line", one))
        effects += more
    return state, effects


# --- the role ---------------------------------------------------------------------------------------------------------


def test_a_packet_goes_by_the_line_as_it_is() -> None:
    assert BRIDGE.handle(Heard(), Received(5, Visca(HOME), "desk")) == (Heard(), (Write("line", HOME),))


@pytest.mark.parametrize("packet", [b"", b"\xff", HOME[:-1], HOME + HOME, bytes(16), b"\x01\x06\xff"])
def test_what_is_no_packet_is_not_sent_to_a_camera(packet: bytes) -> None:
    assert BRIDGE.handle(Heard(), Received(5, Visca(packet), "desk")) == (Heard(), (Ignored("visca"),))


def test_no_other_message_is_sent_to_a_camera() -> None:
    assert BRIDGE.handle(Heard(), Received(5, Question(1), "desk")) == (Heard(), (Ignored("visca"),))


def test_packets_of_the_camera_are_messages_however_they_come() -> None:
    sent = [Send(Visca(ACK), "desk", "serial"), Send(Visca(HOME), "desk", "serial")]
    assert read(ACK + HOME) == (Heard(), sent)
    assert read(*(bytes([one]) for one in ACK + HOME)) == (Heard(), sent)


def test_noise_is_dropped_counted_and_told_later() -> None:
    state, effects = read(b"\xff\x00\xff" + ACK, b"\x90" * 5000, b"\xff" + ACK, now=7)
    ack = Send(Visca(ACK), "desk", "serial")
    assert effects == [ack, SetTimer("dropped", 7 + TELL_NS), ack]
    assert state.dropped == 3
    state, (note,) = BRIDGE.handle(state, Timer(7 + TELL_NS, "dropped"))
    assert note == Note("3 lines from the device dropped, the last of them: visca: what ends with FFh is no packet")
    assert state == Heard()


# --- the plan ---------------------------------------------------------------------------------------------------------


@pytest.fixture(autouse=True)
def registry() -> Iterator[None]:
    tf.register_architecture("own", Watched)
    yield
    ARCHITECTURES.registered.clear()


def test_the_line_of_a_camera_is_bare_and_its_bytes_are_held_a_shorter_time() -> None:
    plan = planned(tf.Scenario.load("zhai-spcpf", {**SMALL, "serial.baud": 9600}))
    camera = next(one for one in bridged(plan, {"camera": "/dev/ttyUSB0"}).processes if one.id == "camera")
    assert camera.config == {"peer": "desk", "kinds": ["visca"], "modules": [], "silent": [], "bare": True}
    assert camera.ports == {"line": Port(device="/dev/ttyUSB0", hold_ns=BARE_HOLD_NS, baud=9600)}
    assert 15 * 10 / 9600 + BARE_HOLD_NS / 1e9 < 0.05  # half of what a controller waits for an ACK


def test_the_control_of_a_camera_may_be_a_program_too() -> None:
    """The camera is emulated, and what tells it is at the other end of the line."""
    plan = planned(tf.Scenario.load("zhai-spcpf", SMALL))
    desk = next(one for one in bridged(plan, {"desk": "pty"}).processes if one.id == "desk")
    assert desk.config["bare"]
    assert desk.config["peer"] == "camera"


def test_a_line_with_frames_and_packets_has_no_device() -> None:
    tf.register_architecture("own", lambda: Watched(framed=True))
    plan = planned(tf.Scenario.load("zhai-spcpf", SMALL))
    with pytest.raises(tf.ScenarioError) as caught:
        bridged(plan, {"camera": "pty"})
    assert str(caught.value) == "--bridge: by the line of camera go packets without frames, visca; expected visca alone"


# --- runs -------------------------------------------------------------------------------------------------------------


def run(trackfield: Call, *options: str) -> Any:
    settings = [word for key, value in SMALL.items() for word in ("--set", f"{key}={value}")]
    return trackfield("run", "zhai-spcpf", *settings, *options, "--out", "out")


def packets(out: Path) -> dict[str, list[bytes]]:
    """Those that the run delivered, by who sent them."""
    found: dict[str, list[bytes]] = {"desk": [], "camera": []}
    for row in tf.open(out).messages.to_pylist():
        if row["medium"] == "serial" and row["outcome"] == "delivered":
            found[row["src"]].append(decode(row["payload"]).packet)
    return found


def test_a_camera_is_unplugged_and_comes_back(trackfield: Call, tmp_path: Path) -> None:
    """Before and after, packets arrive as they were sent, both ways and in spite of noise; the rest is counted."""
    out, cameras = tmp_path / "out", list[Served]()
    log = out / "logs" / "camera.log"

    def serve(plug: Plug, least: int) -> None:
        cameras.append(camera := Served(plug.end))
        until(lambda: camera.got)
        os.write(plug.end, b"noise\xff" + b"\x90" * 5000 + b"\xff")
        until(lambda: len(camera.got) >= least)
        camera.close()

    def attend(plug: Plug) -> None:
        serve(plug, 8)
        plug.unplug()
        until(lambda: "lost" in log.read_text())
        plug.plug()
        serve(plug, 3)

    with closing(Plug(tmp_path / "device")) as plug:
        thread = Thread(target=attend, args=(plug,))
        thread.start()
        ended = run(trackfield, "--serial", str(plug.path))
        thread.join(PATIENCE_S)
    assert ended.code == 0, ended.err
    first, second = cameras
    sent = packets(out)
    numbered = [visca.command_packet(said(number)) for number in range(len(sent["desk"]))]
    assert sent["desk"] == numbered
    assert first.noise == second.noise == 0
    unwritten = json.loads((out / "metrics.json").read_text())["processes"]["unwritten"]
    assert unwritten >= 1
    begins = range(unwritten + 1)  # the first packet may come before the device is open
    assert any(first.got == numbered[begin : begin + len(first.got)] for begin in begins)
    assert len(first.got) + len(second.got) + unwritten <= len(numbered)
    replies = [packet for camera in cameras for _, packet in camera.camera.said]
    assert len(sent["camera"]) >= 8
    assert most_in_order(sent["camera"], replies) == len(sent["camera"])
    assert json.loads((out / "manifest.json").read_text())["bridges"] == {"camera": str(plug.path)}
