"""Payloads on a serial line: whatever is sent comes out, and whatever else comes does no harm to the next line."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trackfield.link.fate import Transmission
from trackfield.link.serial import Serial
from trackfield.wire.error import WireError
from trackfield.wire.line import END, MOST_BYTES, framed, most_bytes, split, stuffed, unframed, unstuffed
from trackfield.wire.registry import MAX_BYTES

payloads = st.binary(max_size=MAX_BYTES) | st.text("\0\1", max_size=600).map(str.encode)
LONG = bytes(range(1, 255))

STUFFED: dict[str, tuple[bytes, bytes]] = {
    "nothing": (b"", b"\x01"),
    "a zero": (b"\0", b"\x01\x01"),
    "two zeros": (b"\0\0", b"\x01\x01\x01"),
    "paper": (b"\x45\0\0\x2c\x4c\x79\0\0\x40\x06\x4f\x37", b"\x02\x45\x01\x04\x2c\x4c\x79\x01\x05\x40\x06\x4f\x37"),
    "a whole block": (LONG, b"\xff" + LONG + b"\x01"),
    "and a byte": (LONG + b"\xff", b"\xff" + LONG + b"\x02\xff"),
    "and a zero": (LONG + b"\0", b"\xff" + LONG + b"\x01\x01"),
    "a byte less": (LONG[1:] + b"\0", b"\xfe" + LONG[1:] + b"\x01"),
}
"""The header of an IP packet is the example of Cheshire & Baker 1999; the others follow from their rules."""


@pytest.mark.parametrize("name", STUFFED)
def test_known_bytes_are_stuffed_as_in_the_paper(name: str) -> None:
    data, expected = STUFFED[name]
    assert stuffed(data) == expected
    assert unstuffed(expected) == data


def test_a_line_that_another_program_would_write() -> None:
    """The check sum of "123456789" by CRC-16/CCITT, begun with 0xFFFF, is 0x29B1."""
    assert framed(b"123456789") == b"\x0c123456789\x29\xb1\0"
    assert framed(b"") == b"\x03\xff\xff\0"


def test_the_last_code_may_be_left_out() -> None:
    """Other programs end a whole block at the end so."""
    assert unstuffed(b"\xff" + LONG) == LONG


@given(st.lists(payloads, max_size=5), st.data())
def test_what_is_sent_comes_out_in_whatever_pieces(sent: list[bytes], data: st.DataObject) -> None:
    line = b"".join(map(framed, sent))
    cuts = sorted(data.draw(st.lists(st.integers(0, len(line)), max_size=6)))
    begun, came = b"", list[bytes]()
    for first, last in zip([0, *cuts], [*cuts, len(line)], strict=True):
        begun, lines = split(begun, line[first:last])
        came += map(unframed, lines)
    assert (begun, came) == (b"", sent)


@given(payloads)
def test_a_line_has_one_end_and_few_bytes_more_than_its_payload(payload: bytes) -> None:
    line = framed(payload)
    assert line.index(END) == len(line) - 1 <= most_bytes(len(payload))


@pytest.mark.parametrize("size", [0, 12, 251, 252, 253, 506, MAX_BYTES])
def test_the_link_counts_the_longest_line_of_a_payload(size: int) -> None:
    most = max(len(framed(bytes([byte]) * size)) for byte in (0, 1))
    fate = Serial(1).fate(Transmission("a", "b", "doa", 0, 0, size))
    assert fate.bytes_on_air == most_bytes(size) + 1
    assert most <= fate.bytes_on_air <= most + 1  # a check sum may have a zero


@given(st.binary(max_size=3 * MOST_BYTES), payloads)
def test_noise_is_one_line_at_most_and_the_next_is_whole(noise: bytes, payload: bytes) -> None:
    begun, lines = split(b"", noise)
    for line in lines:
        refused(line)
    begun, lines = split(begun, END + framed(payload))
    assert begun == b""
    assert unframed(lines[-1]) == payload


@given(payloads, st.integers(0, 2**32), st.integers(1, 255))
def test_an_error_within_a_byte_is_noticed(payload: bytes, where: int, by: int) -> None:
    """The check sum finds each error within 16 bits."""
    checked = bytearray(unstuffed(framed(payload)[:-1]))
    checked[where % len(checked)] ^= by
    assert refused(stuffed(bytes(checked)))


@given(payloads, st.integers(0, 2**32), st.integers(1, 255))
def test_after_a_byte_that_changed_on_the_line_the_next_one_is_whole(payload: bytes, where: int, by: int) -> None:
    """Codes and ends may have changed, too."""
    line = bytearray(framed(payload))
    line[where % len(line)] ^= by
    begun, lines = split(b"", bytes(line) + END + framed(b"next"))
    for one in lines[:-1]:
        refused(one)
    assert (begun, unframed(lines[-1])) == (b"", b"next")


@given(st.binary(min_size=1, max_size=3 * MOST_BYTES).filter(lambda data: END not in data))
def test_a_line_without_end_takes_no_more_memory_than_the_longest(data: bytes) -> None:
    begun, lines = split(b"", data * 3)
    assert len(begun) <= MOST_BYTES + 1
    assert lines == []
    _, (line,) = split(begun, END)
    assert refused(line) or len(data) * 3 <= MOST_BYTES


def test_a_line_that_is_too_long_is_refused_whatever_it_says() -> None:
    with pytest.raises(WireError) as caught:
        unframed(framed(bytes(MAX_BYTES + 20))[:-1])
    assert str(caught.value) == f"line: more than {MOST_BYTES} bytes"


@given(st.binary(max_size=40) | st.binary(min_size=254, max_size=300))
def test_what_is_unstuffed_is_what_was_stuffed(data: bytes) -> None:
    try:
        again = stuffed(unstuffed(data))
    except WireError as error:
        assert error.reason == "line"
    else:
        assert data in (again, again[:-1], b"")  # the last code may be left out


def refused(line: bytes) -> bool:
    """Whether a line carries no payload."""
    try:
        unframed(line)
    except WireError as error:
        assert error.reason == "line"
        return True
    return False
