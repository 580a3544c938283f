"""What a controller says to a camera."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

from trackfield.wire.visca.stream import is_packet
from trackfield.wire.visca.units import (
    END,
    EVERYBODY,
    PAN_SPEEDS,
    PAN_STEPS,
    TILT_SPEEDS,
    TILT_STEPS,
    ZOOM_STEPS,
    nibbles,
    signed,
    speeds,
    unsigned,
    within,
)


@dataclass(frozen=True, slots=True)
class AddressSet:
    """To all: the next camera has this address, and hands on the one after it."""

    address: int = 1


@dataclass(frozen=True, slots=True)
class Clear:
    """Forget all commands (IF_Clear)."""


@dataclass(frozen=True, slots=True)
class Absolute:
    """Turn to a position; speeds and positions in steps (``PAN_SPEEDS``, ``PAN_STEPS``)."""

    pan_speed: int
    tilt_speed: int
    pan: int
    tilt: int


@dataclass(frozen=True, slots=True)
class Relative:
    """Turn by so much; as ``Absolute``."""

    pan_speed: int
    tilt_speed: int
    pan: int
    tilt: int


@dataclass(frozen=True, slots=True)
class Drive:
    """Turn until told otherwise: ``pan`` -1 to the left, 1 to the right, ``tilt`` -1 down, 1 up, 0 stop."""

    pan_speed: int
    tilt_speed: int
    pan: int
    tilt: int


@dataclass(frozen=True, slots=True)
class Home:
    """Turn to the middle."""


@dataclass(frozen=True, slots=True)
class Reset:
    """Set up pan and tilt anew."""


@dataclass(frozen=True, slots=True)
class Zoom:
    """Zoom to a position, 0 (wide) to ``ZOOM_STEPS``."""

    position: int


@dataclass(frozen=True, slots=True)
class Power:
    """Switch the camera on or off."""

    on: bool


@dataclass(frozen=True, slots=True)
class Cancel:
    """Give up the command in this socket."""

    socket: int


@dataclass(frozen=True, slots=True)
class Ask:
    """Ask the camera for one of ``QUESTIONS``."""

    what: str


Command = AddressSet | Clear | Absolute | Relative | Drive | Home | Reset | Zoom | Power | Cancel | Ask

QUESTIONS: Final = {
    "position": bytes([0x09, 0x06, 0x12]),
    "speeds": bytes([0x09, 0x06, 0x11]),
    "zoom": bytes([0x09, 0x04, 0x47]),
    "power": bytes([0x09, 0x04, 0x00]),
    "version": bytes([0x09, 0x00, 0x02]),
}
"""Inquiries, by what is asked for."""


class Told(NamedTuple):
    """A command, and the address of the camera that is told."""

    address: int
    command: Command


def command_packet(command: Command, address: int = 1) -> bytes:
    """The packet that tells a camera this. Raises ``ValueError`` for what no packet can carry."""
    if isinstance(command, AddressSet):
        return bytes([0x80 | EVERYBODY, 0x30, within(command.address, range(1, 9)), END])
    try:
        return bytes([0x80 | within(address, range(1, 9)), *_body(command), END])
    except KeyError as error:
        raise ValueError(f"{error} is not in any command") from None


def _body(command: Command) -> bytes:
    """A command in a packet, between its first byte and its last."""
    match command:
        case Absolute(pan_speed, tilt_speed, pan, tilt):
            body = [1, 6, 2, *speeds(pan_speed, tilt_speed), *_place(pan), *_place(tilt)]
        case Relative(pan_speed, tilt_speed, pan, tilt):
            body = [1, 6, 3, *speeds(pan_speed, tilt_speed), *_place(pan), *_place(tilt)]
        case Drive(pan_speed, tilt_speed, pan, tilt):
            body = [1, 6, 1, *speeds(pan_speed, tilt_speed), _PANS[pan], _TILTS[tilt]]
        case Zoom(position):
            body = [1, 4, 0x47, *nibbles(within(position, range(0x10000)))]
        case Power(on):
            body = [1, 4, 0, 2 if on else 3]
        case Cancel(socket):
            body = [0x20 | within(socket, range(16))]
        case Ask(what):
            return QUESTIONS[what]
        case _:
            return FIXED[type(command)]
    return bytes(body)


def _place(steps: int) -> bytes:
    """A position in a packet. Raises ``ValueError``."""
    return nibbles(within(steps, range(-0x8000, 0x8000)))


FIXED: Final[dict[type, bytes]] = {
    Clear: bytes([0x01, 0x00, 0x01]),
    Home: bytes([0x01, 0x06, 0x04]),
    Reset: bytes([0x01, 0x06, 0x05]),
}
_PANS: Final = {-1: 1, 1: 2, 0: 3}
_TILTS: Final = {1: 1, -1: 2, 0: 3}


def command_of(packet: bytes) -> Told | None:
    """The command of a packet; None if it is none that an EVI-D30 knows, or has values that it does not take."""
    if not is_packet(packet) or packet[0] & 0xF0 != 0x80:
        return None
    address, body = packet[0] & 0x0F, packet[1:-1]
    if body[0] == 0x30:
        given = len(body) == 2 and address == EVERYBODY and 1 <= body[1] <= EVERYBODY
        return Told(address, AddressSet(body[1])) if given else None
    command = _command(body)
    return None if command is None or not 1 <= address <= EVERYBODY else Told(address, command)


def _command(body: bytes) -> Command | None:
    """The command in a packet between its first byte and its last."""
    for what, question in QUESTIONS.items():
        if body == question:
            return Ask(what)
    for kind, fixed in FIXED.items():
        if body == fixed:
            return kind()  # type: ignore[no-any-return]
    if len(body) == 1 and body[0] >> 4 == 2:
        return Cancel(body[0] & 0x0F)
    if body[:3] == b"\x01\x04\x47" and len(body) == 7:
        zoom = unsigned(body[3:])
        return Zoom(zoom) if zoom is not None and zoom <= ZOOM_STEPS else None
    if body[:3] == b"\x01\x04\x00" and len(body) == 4 and body[3] in (2, 3):
        return Power(body[3] == 2)
    return _turn(body) if body[:2] == b"\x01\x06" and len(body) >= 5 else None


def _turn(body: bytes) -> Command | None:
    """A command to pan and tilt."""
    kind, pan_speed, tilt_speed, rest = body[2], body[3], body[4], body[5:]
    if pan_speed not in PAN_SPEEDS or tilt_speed not in TILT_SPEEDS:
        return None
    if kind == 1 and len(rest) == 2:
        pans, tilts = ({value: key for key, value in table.items()} for table in (_PANS, _TILTS))
        known = rest[0] in pans and rest[1] in tilts
        return Drive(pan_speed, tilt_speed, pans[rest[0]], tilts[rest[1]]) if known else None
    if kind not in (2, 3) or len(rest) != 8:
        return None
    pan, tilt = signed(rest[:4]), signed(rest[4:])
    if pan is None or tilt is None:
        return None
    if kind == 3:
        return Relative(pan_speed, tilt_speed, pan, tilt)
    there = abs(pan) <= PAN_STEPS and abs(tilt) <= TILT_STEPS
    return Absolute(pan_speed, tilt_speed, pan, tilt) if there else None
