"""What a camera says to its controller."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

from trackfield.wire.visca.commands import FIXED, Clear
from trackfield.wire.visca.stream import is_packet
from trackfield.wire.visca.units import CAMERAS, CONTROLLER, END, EVERYBODY, LEAST_BYTES, MOST_BYTES, within

VERSION: Final = bytes([0x00, 0x20, 0x04, 0x02, 0x00, 0x01, 0x02])
"""What an EVI-D30 says of itself: Sony, model 0402h, the edition of its program, its sockets."""

SYNTAX: Final = 0x02
FULL: Final = 0x03
CANCELLED: Final = 0x04
NO_SOCKET: Final = 0x05
NOT_EXECUTABLE: Final = 0x41
WORDS: Final = {
    SYNTAX: "syntax error",
    FULL: "command buffer full",
    CANCELLED: "command cancelled",
    NO_SOCKET: "no socket",
    NOT_EXECUTABLE: "command not executable",
}
"""Why a command failed, by its number."""


@dataclass(frozen=True, slots=True)
class Ack:
    """The command was taken, and has this socket."""

    socket: int


@dataclass(frozen=True, slots=True)
class Completion:
    """The command in this socket is done."""

    socket: int


@dataclass(frozen=True, slots=True)
class Failure:
    """A command failed, ``why`` by number (``WORDS``); ``socket`` 0: it never had one."""

    socket: int
    why: int


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer to an inquiry."""

    data: bytes


@dataclass(frozen=True, slots=True)
class NextAddress:
    """An ``AddressSet`` has been through all cameras; a further one would have this address."""

    address: int


@dataclass(frozen=True, slots=True)
class Cleared:
    """A ``Clear`` for all has been through all cameras."""


@dataclass(frozen=True, slots=True)
class Changed:
    """A camera was connected or lost its power: addresses have to be set anew."""


Reply = Ack | Completion | Failure | Answer | NextAddress | Cleared | Changed


class Replied(NamedTuple):
    """A reply, and the address of the camera that sent it; ``EVERYBODY`` if it went through all."""

    address: int
    reply: Reply


def reply_packet(reply: Reply, address: int = 1) -> bytes:
    """The packet by which a camera says this. Raises ``ValueError`` for what no packet can carry."""
    if isinstance(reply, NextAddress):
        return bytes([0x80 | EVERYBODY, 0x30, within(reply.address, range(1, 9)), END])
    if isinstance(reply, Cleared):
        return bytes([0x80 | EVERYBODY, *FIXED[Clear], END])
    return bytes([0x80 | within(address, CAMERAS) << 4, *_said(reply), END])


def _said(reply: Reply) -> bytes:
    match reply:
        case Ack(socket):
            return bytes([0x40 | within(socket, range(16))])
        case Completion(socket):
            return bytes([0x50 | within(socket, range(16))])
        case Failure(socket, why):
            return bytes([0x60 | within(socket, range(16)), within(why, range(END))])
        case Answer(data):
            if not 1 <= len(data) <= MOST_BYTES - LEAST_BYTES or END in data:
                raise ValueError(f"an answer has 1 to {MOST_BYTES - LEAST_BYTES} bytes, none of them FFh")
            return bytes([0x50, *data])
    return bytes([0x38])


def reply_of(packet: bytes) -> Replied | None:
    """The reply of a packet; None if it is none."""
    if not is_packet(packet):
        return None
    if packet[0] == 0x80 | EVERYBODY:
        return _went_round(packet[1:-1])
    address, kind, socket, rest = packet[0] >> 4 & 7, packet[1] & 0xF0, packet[1] & 0x0F, packet[2:-1]
    if packet[0] & 0x0F != CONTROLLER or address not in CAMERAS:
        return None
    reply: Reply | None = None
    if not rest:
        simple: dict[int, Reply] = {0x40: Ack(socket), 0x50: Completion(socket)}
        reply = Changed() if packet[1] == 0x38 else simple.get(kind)
    elif kind == 0x60 and len(rest) == 1:
        reply = Failure(socket, rest[0])
    elif kind == 0x50 and socket == 0:
        reply = Answer(rest)
    return None if reply is None else Replied(address, reply)


def _went_round(body: bytes) -> Replied | None:
    if body == FIXED[Clear]:
        return Replied(EVERYBODY, Cleared())
    if len(body) == 2 and body[0] == 0x30 and 1 <= body[1] <= EVERYBODY:
        return Replied(EVERYBODY, NextAddress(body[1]))
    return None
