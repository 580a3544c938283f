"""VISCA as values: packets written by hand from the manuals, round trips, and lines with noise."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any, get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trackfield.wire import visca
from trackfield.wire.visca import command_of, command_packet, reply_of, reply_packet

GOLDEN: dict[str, Any] = json.loads((Path(__file__).parent / "golden" / "visca.json").read_text())

ADDRESSES = st.sampled_from(visca.CAMERAS)
TURNS = st.sampled_from(visca.PAN_SPEEDS), st.sampled_from(visca.TILT_SPEEDS)
WAYS = st.integers(-1, 1)
PLACES = st.integers(-visca.PAN_STEPS, visca.PAN_STEPS), st.integers(-visca.TILT_STEPS, visca.TILT_STEPS)
WORDS16 = st.integers(-0x8000, 0x7FFF)
TO_ONE = st.one_of(
    st.builds(visca.Absolute, *TURNS, *PLACES),
    st.builds(visca.Relative, *TURNS, WORDS16, WORDS16),
    st.builds(visca.Drive, *TURNS, WAYS, WAYS),
    st.builds(visca.Zoom, st.integers(0, visca.ZOOM_STEPS)),
    st.builds(visca.Power, st.booleans()),
    st.builds(visca.Cancel, st.integers(0, 15)),
    st.builds(visca.Ask, st.sampled_from(list(visca.QUESTIONS))),
    st.sampled_from([visca.Clear(), visca.Home(), visca.Reset()]),
)
SOCKETS = st.integers(0, 15)
BY_ONE = st.one_of(
    st.builds(visca.Ack, SOCKETS),
    st.builds(visca.Completion, SOCKETS),
    st.builds(visca.Failure, SOCKETS, st.integers(0, 0xFE)),
    st.builds(visca.Answer, st.lists(st.integers(0, 0xFE), min_size=1, max_size=13).map(bytes)),
    st.just(visca.Changed()),
)


@pytest.mark.parametrize("text", GOLDEN["commands"])
def test_a_command_of_the_manual_is_read_and_written(text: str) -> None:
    address, value = GOLDEN["commands"][text]
    told = command_of(bytes.fromhex(text))
    assert told is not None
    assert (told.address, repr(told.command)) == (address, value)
    assert command_packet(told.command, address).hex(" ").upper() == text


@pytest.mark.parametrize("text", GOLDEN["replies"])
def test_a_reply_of_the_manual_is_read_and_written(text: str) -> None:
    address, value = GOLDEN["replies"][text]
    replied = reply_of(bytes.fromhex(text))
    assert replied is not None
    assert (replied.address, repr(replied.reply)) == (address, value)
    assert reply_packet(replied.reply, address).hex(" ").upper() == text


@pytest.mark.parametrize("text", GOLDEN["syntax errors"])
def test_what_the_camera_does_not_know_or_take_is_no_command(text: str) -> None:
    assert visca.is_packet(bytes.fromhex(text))
    assert command_of(bytes.fromhex(text)) is None


def test_packets_in_the_docs_are_packets() -> None:
    text = (Path(__file__).parents[1] / "docs" / "visca.md").read_text()
    packets = [bytes.fromhex(one) for one in re.findall(r"`((?:[0-9A-F]{2} )+FF)`", text)]
    understood = [one for one in packets if command_of(one) or reply_of(one)]
    assert len(packets) > 20
    assert [one.hex() for one in packets] == [one.hex() for one in understood]
    kinds = {type(told.command) for told in map(command_of, packets) if told is not None}
    assert kinds == {*get_args(visca.Command)}


def test_speeds_are_those_of_the_manual() -> None:
    pan, tilt = GOLDEN["speeds"]["pan"], GOLDEN["speeds"]["tilt"]
    assert len(pan) == len(visca.PAN_SPEEDS)
    assert len(tilt) == len(visca.TILT_SPEEDS)
    assert [visca.pan_deg_s(one) for one in visca.PAN_SPEEDS] == pytest.approx(pan, abs=0.051)
    assert [visca.tilt_deg_s(one) for one in visca.TILT_SPEEDS] == pytest.approx(tilt, abs=0.001)


def test_positions_are_those_of_the_manual() -> None:
    assert visca.nibbles(visca.pan_steps(-100)) == bytes.fromhex("0F0C0900")
    assert visca.nibbles(visca.pan_steps(100)) == bytes.fromhex("00030700")
    assert visca.nibbles(visca.tilt_steps(-25)) == bytes.fromhex("0F0E0D04")
    assert visca.nibbles(visca.tilt_steps(25)) == bytes.fromhex("0001020C")


@given(st.integers(-visca.PAN_STEPS, visca.PAN_STEPS))
def test_a_position_is_that_of_its_angle(steps: int) -> None:
    assert visca.pan_steps(visca.pan_deg(steps)) == steps
    assert visca.tilt_steps(visca.tilt_deg(steps)) == steps


@given(TO_ONE, ADDRESSES)
def test_a_command_comes_back(command: visca.Command, address: int) -> None:
    packet = command_packet(command, address)
    assert visca.is_packet(packet)
    assert command_of(packet) == visca.Told(address, command)


@given(st.integers(1, 8))
def test_a_command_to_all_comes_back(address: int) -> None:
    for command in (visca.AddressSet(address), visca.Clear()):
        assert command_of(command_packet(command, visca.EVERYBODY)) == visca.Told(visca.EVERYBODY, command)
    assert reply_of(reply_packet(visca.NextAddress(address))) == (visca.EVERYBODY, visca.NextAddress(address))


@given(BY_ONE, ADDRESSES)
def test_a_reply_comes_back(reply: visca.Reply, address: int) -> None:
    packet = reply_packet(reply, address)
    assert visca.is_packet(packet)
    assert reply_of(packet) == visca.Replied(address, reply)


def test_the_first_camera_is_meant_unless_another_one_is_named() -> None:
    assert command_packet(visca.Home()) == bytes.fromhex("81 01 06 04 FF")
    assert command_packet(visca.AddressSet()) == bytes.fromhex("88 30 01 FF")
    assert reply_packet(visca.Ack(2)) == bytes.fromhex("90 42 FF")


def test_errors_have_the_numbers_of_the_manual() -> None:
    words = {2: "syntax error", 3: "command buffer full", 4: "command cancelled", 5: "no socket"}
    assert {**words, 0x41: "command not executable"} == visca.WORDS
    assert (visca.SYNTAX, visca.FULL, visca.CANCELLED, visca.NO_SOCKET) == (2, 3, 4, 5)
    assert visca.NOT_EXECUTABLE == 0x41


@pytest.mark.parametrize("reply", [visca.Ack(16), visca.Completion(16), visca.Failure(16, 2), visca.Failure(1, 0xFF)])
def test_a_reply_that_no_packet_carries_is_refused(reply: visca.Reply) -> None:
    with pytest.raises(ValueError, match="is not in"):
        reply_packet(reply)


@pytest.mark.parametrize("number", [-0x8001, 0x10000])
def test_a_number_beyond_16_bits_is_refused(number: int) -> None:
    with pytest.raises(ValueError, match=r"is not in -32768\.\.65535"):
        visca.nibbles(number)


WRONG: list[visca.Command] = [
    visca.Absolute(0, 1, 0, 0),
    visca.Absolute(1, 0x15, 0, 0),
    visca.Absolute(1, 1, 0x8000, 0),
    visca.Relative(1, 1, 0, -0x8001),
    visca.Drive(1, 1, 2, 0),
    visca.Drive(1, 1, 0, -2),
    visca.Zoom(-1),
    visca.Zoom(0x10000),
    visca.Cancel(16),
    visca.Ask("weather"),
    visca.AddressSet(0),
    visca.AddressSet(9),
]


@pytest.mark.parametrize("command", WRONG, ids=repr)
def test_what_no_packet_carries_is_refused(command: visca.Command) -> None:
    with pytest.raises(ValueError, match="is not in"):
        command_packet(command)


@pytest.mark.parametrize("address", [0, 9])
def test_an_address_that_no_camera_has_is_refused(address: int) -> None:
    with pytest.raises(ValueError, match="is not in"):
        command_packet(visca.Home(), address)
    with pytest.raises(ValueError, match="is not in"):
        reply_packet(visca.Ack(1), address)


@pytest.mark.parametrize("data", [b"", b"\xff", bytes(14)])
def test_an_answer_that_does_not_fit_is_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match="an answer has 1 to 13 bytes"):
        reply_packet(visca.Answer(data))


# --- what comes by a line ---------------------------------------------------------------------------------------------


@given(st.binary(max_size=20))
def test_any_bytes_are_read(data: bytes) -> None:
    """Whatever is understood is exactly what our own would send."""
    for packet in (data, data + b"\xff", b"\x81" + data + b"\xff", b"\x90" + data + b"\xff", b"\x88" + data + b"\xff"):
        told, replied = command_of(packet), reply_of(packet)
        assert told is None or command_packet(told.command, told.address) == packet
        assert replied is None or reply_packet(replied.reply, replied.address) == packet


PACKETS = st.lists(st.builds(command_packet, TO_ONE, ADDRESSES) | st.builds(reply_packet, BY_ONE, ADDRESSES))


@given(PACKETS, st.lists(st.integers(1, 40)))
def test_packets_are_found_however_they_are_cut(packets: list[bytes], cuts: list[int]) -> None:
    stream, begun, found, noise = b"".join(packets), b"", list[bytes](), 0
    for cut in [*cuts, len(stream)]:
        heard = visca.split(begun, stream[:cut])
        stream, begun = stream[cut:], heard.begun
        found += heard.packets
        noise += heard.noise
    assert (found, begun, noise) == (packets, b"", 0)


@given(st.binary(max_size=100), st.lists(st.integers(0, 0xFE), max_size=60).map(bytes))
def test_noise_is_bounded_and_spoils_no_later_packet(noise: bytes, half: bytes) -> None:
    """Whatever came before, a packet after an end is found."""
    packet = command_packet(visca.Home())
    heard = visca.split(half, noise)
    assert len(heard.begun) <= visca.MOST_BYTES
    assert all(visca.is_packet(one) for one in heard.packets)
    assert len(heard.packets) + heard.noise == noise.count(0xFF)
    after = visca.split(heard.begun, b"\xff" + packet)
    assert after.packets[-1] == packet


@pytest.mark.parametrize("length", [2, 3, 16, 17, 500])
def test_a_packet_has_3_to_16_bytes(length: int) -> None:
    data = b"\x90" + bytes(length - 2) + b"\xff"
    found: list[bytes] = []
    begun = b""
    for one in data:
        heard = visca.split(begun, bytes([one]))
        begun, found = heard.begun, found + heard.packets
    assert found == ([data] if length in (3, 16) else [])
    assert visca.is_packet(data) == (length in (3, 16))


def test_a_packet_begins_with_its_address() -> None:
    heard = visca.split(b"", bytes.fromhex("10 41 FF 90 41 FF"))
    assert heard == (b"", [bytes.fromhex("90 41 FF")], 1)
