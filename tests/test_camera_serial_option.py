"""``--serial``: a real camera in the place of the one that the run emulates, and what is refused."""

from __future__ import annotations

import json
import os
import termios
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

import trackfield as tf
from tests.cameras import Served, most_in_order
from tests.command_line import Call, trackfield
from tests.running import PATIENCE_S, until
from trackfield.wire import decode, visca
from trackfield.wire.visca import Absolute, Ack, Completion

__all__ = ["trackfield"]

CAMERA = ("--set", "sensor.waveform=false")
ONCE = ("--set", "target.steps=32")
"""One pass, and the time until the camera has turned."""


@pytest.fixture
def ask(trackfield: Call) -> Any:
    """``validate`` of a field with a camera, and these options."""
    return lambda *options: trackfield("validate", "yang-ecpa", *CAMERA, *options)


WRONG: dict[str, tuple[tuple[str, ...], str]] = {
    "virtual": (("--serial", "pty", "--virtual"), "there is no device in virtual time; expected it without --virtual"),
    "speed": (("--serial", "pty", "--speed", "2"), "a device goes by the wall clock; expected it with --speed 1"),
    "external": (
        ("--serial", "pty", "--external", "--connect", "tcp/127.0.0.1:1"),
        "the processes start elsewhere; expected it without --external",
    ),
    "twice": (("--serial", "pty", "--serial", "/dev/ttyUSB0"), "is there twice; expected one device: a field has one"),
    "both": (("--serial", "pty", "--bridge", "camera=pty"), "camera has a device by --bridge; expected one of both"),
    "shared": (
        ("--serial", "/dev/ttyUSB0", "--bridge", "base=/dev/ttyUSB0"),
        "/dev/ttyUSB0 is there twice; expected a device of its own for each process",
    ),
    "empty": (("--serial", ""), "is ''; expected a serial device, like /dev/ttyUSB0, or pty"),
    "control": (("--serial", "/dev/tty\x07"), "is '/dev/tty\\x07'; expected a serial device"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_a_camera_that_cannot_be_is_refused_with_one_message(name: str, ask: Any) -> None:
    options, message = WRONG[name]
    said = ask(*options)
    assert said.code == 2
    assert said.err.startswith(f"trackfield: --serial: {message}")
    assert said.err.count("\n") == 1


def test_a_field_without_a_camera_has_none_to_replace(trackfield: Call) -> None:
    said = trackfield("validate", "zhai-spcpf", "--serial", "pty")
    assert said.code == 2
    message = 'zhai-spcpf has no camera; expected a scenario with one, by camera.kind = "evi-d30"'
    assert said.err == f"trackfield: --serial: {message}\n"


def test_a_device_that_is_not_there_yet_is_a_warning(ask: Any) -> None:
    said = ask("--serial", "/dev/ttyUSB77")
    assert said.code == 0
    assert "/dev/ttyUSB77 is not there yet, and waited for: what is sent to camera meanwhile is lost" in said.err
    assert "a real device is in the place of camera: where it looks is not recorded" in said.err


def test_a_camera_at_a_pseudo_terminal_goes_away_comes_back_and_is_turned_to_a_vehicle(
    trackfield: Call, tmp_path: Path
) -> None:
    """The camera is ours, but as a program of its own. When it comes back it is another one, without an address."""
    out, cameras = tmp_path / "out", list[Served]()
    log = out / "logs" / "camera.log"

    def serve(over: Callable[[], object]) -> None:
        file = until(lambda: os.open(out / "camera.tty", os.O_RDWR | os.O_NOCTTY))
        termios.tcflush(file, termios.TCIFLUSH)  # what was for the one before
        with closing(Served(file)) as served:
            cameras.append(served)
            until(over)
        os.close(file)

    def attend() -> None:
        where = visca.command_packet(visca.Ask("position"))
        serve(lambda: where in cameras[0].got)
        until(lambda: log.read_text().count("waited for") >= 2)
        serve(lambda: not (out / "camera.tty").is_symlink())

    thread = Thread(target=attend)
    thread.start()
    said = trackfield("run", "yang-ecpa", *CAMERA, *ONCE, "--serial", "pty", "--out", "out")
    thread.join(PATIENCE_S)
    assert said.code == 0, said.err
    assert f"in the place of camera: {Path('out') / 'camera.tty'}\n" in said.err
    first, second = cameras
    rows = [row for row in tf.open(out).messages.to_pylist() if row["kind"] == "visca"]
    told, replied = ([_packet(row) for row in rows if row["src"] == src] for src in ("camera-control", "camera"))
    metrics = json.loads((out / "metrics.json").read_text())
    got, unwritten, late = [*first.got, *second.got], metrics["processes"]["unwritten"], metrics["timing"]["host_late"]
    assert len(got) - most_in_order(got, told) <= late  # what was taken back when it had left already is told
    assert first.noise == second.noise == 0
    assert 0 < unwritten <= len(told) + late - len(got)
    for camera in cameras:  # each was given an address, and asked where it looks, before anything else
        begun = [one.command for one in map(visca.command_of, camera.got) if one is not None]
        assert isinstance(begun[0], visca.AddressSet)
        assert visca.Ask("position") in begun
    assert any(isinstance(one, Absolute) for one in begun)
    assert abs(second.camera.look().pan) > 5
    heard = [one.reply for one in map(visca.reply_of, replied) if one is not None]
    assert any(isinstance(one, Ack) for one in heard)
    assert any(isinstance(one, Completion) for one in heard)
    assert json.loads((out / "manifest.json").read_text())["bridges"] == {"camera": "pty"}


def test_how_many_are_in_order() -> None:
    a, b, c = b"a", b"b", b"c"
    assert most_in_order([a, b, c], [c, a, c, b, b, c]) == 3
    assert most_in_order([c, c, a], [a, b, c]) == 1
    assert most_in_order([], [a]) == most_in_order([a], []) == 0


def _packet(row: dict[str, Any]) -> bytes:
    packet: bytes = decode(row["payload"]).packet
    return packet
