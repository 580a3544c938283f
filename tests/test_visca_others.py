"""Two implementations of VISCA that are not ours drive our camera, and their packets are those of our codec.

pyvisca (GPL-3) speaks to serial lines: it has one, with our camera at its other end. visca_over_ip (Unlicense) puts the
same packets into datagrams, each with 8 bytes before it: here these are taken off, and time goes on only as it waits.
Neither is a part of Trackfield, which does not import them.
"""

from __future__ import annotations

import os
import tty
from collections.abc import Iterator
from contextlib import closing
from types import SimpleNamespace
from typing import Any

import pytest
import visca_over_ip.camera as over_ip
from pyvisca.visca import PTZ

from tests.cameras import MS, Driven, Served
from tests.running import until
from trackfield.role import NS
from trackfield.wire import visca
from trackfield.wire.visca import Absolute, Ask, Drive, Home, Power, Relative, Reset, Zoom, command_packet

# --- by a serial line -------------------------------------------------------------------------------------------------


@pytest.fixture
def served() -> Iterator[Served]:
    """Our camera at a terminal; ``served.path`` is the other end of that."""
    file, other = os.openpty()
    tty.setraw(other)
    served = Served(file)
    served.path = os.ttyname(other)
    with closing(served):
        yield served
    os.close(other)
    os.close(file)


def rested(served: Served) -> None:
    """Wait until the camera has done what it was told."""
    told = len(served.got)
    until(lambda: len(served.got) == told and served.camera.timer < 0 and not served.camera.state.waiting)
    until(lambda: served.sent == len(served.camera.said))


def test_pyvisca_turns_our_camera_by_a_serial_line(served: Served) -> None:
    other = PTZ(output=served.path)
    try:
        other.set_pan(300, speed=20)
        until(lambda: len(served.got) >= 2)
        rested(served)
        assert other.get_pan() == 300
        other.set_tilt(120, speed=20)
        until(lambda: len(served.got) >= 5)
        rested(served)
        other.set_zoom(0x155)
        until(lambda: len(served.got) >= 6)
        rested(served)
        assert (other.get_pan(), other.get_tilt(), other.get_zoom(), other.get_power()) == (300, 120, 0x155, 1)
    finally:
        other.close()
    assert served.camera.look() == pytest.approx((visca.pan_deg(300), visca.tilt_deg(120)))
    where = Ask("position")
    turns = [where, Absolute(20, 20, 300, 0), where, where, Absolute(20, 20, 300, 120)]
    asks = [Zoom(0x155), where, where, Ask("zoom"), Ask("power")]
    assert served.got == [command_packet(one) for one in [*turns, *asks]]
    assert served.noise == 0


def test_pyvisca_says_what_our_codec_says(monkeypatch: pytest.MonkeyPatch) -> None:
    """But for positions below 0, which it sends one too low: -1 is FFFEh there, and FFFFh by Sony's lists."""
    sent: list[bytes] = []
    monkeypatch.setattr(PTZ, "__init__", lambda self: None)
    monkeypatch.setattr(PTZ, "comm", lambda self, text: sent.append(bytes.fromhex(text)))
    monkeypatch.setattr(PTZ, "get_tilt", lambda self: 7)
    monkeypatch.setattr(PTZ, "get_pan", lambda self: 9)
    other = PTZ()
    told: list[tuple[Any, visca.Command]] = [
        (other.set_pan(880, 0x14), Absolute(0x14, 0x14, 880, 7)),
        (other.set_pan(-879, 0x14), Absolute(0x14, 0x14, -880, 7)),
        (other.set_tilt(300, 1), Absolute(1, 1, 9, 300)),
        (other.set_pan_rel(44, 2), Relative(2, 2, 44, 0)),
        (other.set_tilt_rel(30, 3), Relative(3, 3, 0, 30)),
        (other.left(24), Drive(24, 0x15, -1, 0)),
        (other.left_up(5, 6), Drive(5, 6, -1, 1)),
        (other.right_down(7, 8), Drive(7, 8, 1, -1)),
        (other.home(), Home()),
        (other.reset(), Reset()),
        (other.cancel(), visca.Clear()),
        (other.power(0), Power(on=False)),
        (other.power(1), Power(on=True)),
        (other.set_zoom(1023), Zoom(1023)),
    ]
    commands = [command for _, command in told]
    assert len(sent) == len(commands)
    for packet, command in zip(sent, commands, strict=True):
        if command == Drive(24, 0x15, -1, 0):  # faster than an EVI-D30 tilts: it is no command for it
            assert visca.command_of(packet) is None
        else:
            assert packet == command_packet(command)


# --- in datagrams -----------------------------------------------------------------------------------------------------


class Datagrams:
    """What is a socket to visca_over_ip: at its other end is our camera, whose time goes on while it waits."""

    camera: Driven
    sent: list[bytes]
    numbers: dict[int, bytes]
    """Of the datagram by which each socket of the camera was taken."""

    def __init__(self, *how: int) -> None:
        self.ready: list[bytes] = []
        self.number = b""

    def bind(self, at: tuple[str, int]) -> None:
        pass

    def settimeout(self, seconds: float) -> None:
        self.patience_ns = round(seconds * NS)

    def setsockopt(self, *option: int) -> None:
        pass

    def getsockname(self) -> tuple[str, int]:
        return "", 1

    def close(self) -> None:
        pass

    def sendto(self, data: bytes, at: tuple[str, int]) -> None:
        assert int.from_bytes(data[2:4], "big") == len(data) - 8
        if data[:2] == b"\x01\x00":  # a packet, and not a number to begin with
            self.number = data[4:8]
            self.sent.append(data[8:])
            self.camera.packet(data[8:])

    def recv(self, most: int) -> bytes:
        end = self.camera.now + self.patience_ns
        while not self.ready and self.camera.now < end:
            self.camera.until(self.camera.now + MS)
            self.ready += [self._numbered(packet) for _, packet in self.camera.said]
            self.camera.said.clear()
        if not self.ready:
            raise TimeoutError
        return self.ready.pop(0)

    def _numbered(self, packet: bytes) -> bytes:
        replied = visca.reply_of(packet)
        assert replied is not None
        number = self.number
        match replied.reply:
            case visca.Ack(socket):
                self.numbers[socket] = number
            case visca.Completion(socket) if socket:
                number = self.numbers[socket]
        return b"\x01\x11" + len(packet).to_bytes(2, "big") + number + packet


@pytest.fixture
def other(monkeypatch: pytest.MonkeyPatch) -> over_ip.Camera:
    """visca_over_ip, with our camera."""
    Datagrams.camera, Datagrams.sent, Datagrams.numbers = Driven(), [], {}
    Datagrams.camera.said.clear()
    sockets = SimpleNamespace(
        socket=Datagrams, timeout=TimeoutError, AF_INET=0, SOCK_DGRAM=0, SOL_SOCKET=0, SO_REUSEADDR=0
    )
    monkeypatch.setattr(over_ip, "socket", sockets)
    return over_ip.Camera("camera")


def waited(seconds: float) -> None:
    """The camera has so much time."""
    Datagrams.camera.until(Datagrams.camera.now + round(seconds * NS))
    Datagrams.camera.said.clear()


def test_visca_over_ip_turns_our_camera(other: over_ip.Camera) -> None:
    for pan, tilt in ((880, 300), (-880, -300), (1, -1), (0, 0)):
        other.pantilt(24, 20, pan, tilt)
        waited(4)
        assert other.get_pantilt_position() == (pan, tilt)
        assert Datagrams.camera.look() == pytest.approx((visca.pan_deg(pan), visca.tilt_deg(tilt)))
    other.pantilt(24, 20, -100, 50, relative=True)
    waited(4)
    assert other.get_pantilt_position() == (-100, 50)
    other.pantilt_home()
    waited(4)
    assert other.get_pantilt_position() == (0, 0)
    other.zoom_to(0.05)
    waited(1)
    assert other.get_zoom_position() == int(0.05 * 16384)
    assert other.num_missed_responses == 1  # to the number to begin with, which no camera at a serial line gets


def test_visca_over_ip_says_what_our_codec_says(other: over_ip.Camera) -> None:
    calls: list[tuple[Any, visca.Command]] = [
        (lambda: other.pantilt(24, 20, -880, 300), Absolute(24, 20, -880, 300)),
        (lambda: other.pantilt(1, 1, -1, -1, relative=True), Relative(1, 1, -1, -1)),
        (lambda: other.pantilt(5, -6), Drive(5, 6, 1, 1)),  # its signs are its own: 1 is up to Sony
        (lambda: other.pantilt(-5, 6), Drive(5, 6, -1, -1)),
        (other.pantilt_home, Home()),
        (other.pantilt_reset, Reset()),
        (other.get_pantilt_position, Ask("position")),
        (other.get_zoom_position, Ask("zoom")),
    ]
    assert Datagrams.sent == [command_packet(visca.Clear())]
    for call, command in calls:
        Datagrams.sent.clear()
        call()
        waited(4)
        assert Datagrams.sent == [command_packet(command)]


def test_visca_over_ip_is_told_of_errors(other: over_ip.Camera) -> None:
    with pytest.raises(over_ip.ViscaException, match="Syntax error"):
        other.pantilt(24, 24, 0, 0)  # an EVI-D30 does not tilt as fast
    with pytest.raises(over_ip.ViscaException, match="Syntax error"):
        other.pantilt(24, 20, 881, 0)  # nor pan as far
    waited(1)
    other.set_power(False)
    waited(1)
    with pytest.raises(over_ip.ViscaException, match="Command not executable"):
        other.pantilt(24, 20, 100, 0)
    other.set_power(True)
    waited(1)
    for pan in (880, -880):
        other.pantilt(1, 1, pan, 0)
    with pytest.raises(over_ip.ViscaException, match="Command buffer full"):
        other.pantilt_home()
