"""A bridge: in the place of a process, it lets a device at a serial line talk with the process at the other end."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any, Final, Protocol

from trackfield.role import (
    NS,
    Effect,
    Event,
    Ignored,
    Note,
    PortRead,
    Radio,
    Received,
    Send,
    SetTimer,
    Started,
    Timer,
    Write,
)
from trackfield.wire import line, visca
from trackfield.wire.codec import decode, encode
from trackfield.wire.error import WireError
from trackfield.wire.keys import Medium
from trackfield.wire.outside import Visca
from trackfield.words import plain

PORT: Final = "line"
"""The port at which the device is."""
TELL_NS: Final = NS
"""How often lines that were dropped are told."""


@dataclass(frozen=True, slots=True)
class Heard:
    """What of a line has come, and how many lines were dropped since that was told, the last of them ``why``."""

    begun: bytes = b""
    dropped: int = 0
    why: str = ""


class Ways(Protocol):
    """How messages travel by the line to a device."""

    def written(self, message: Any) -> bytes:
        """The bytes of a message; raises ``WireError`` for one that the device cannot be sent."""
        ...

    def heard(self, begun: bytes, data: bytes) -> tuple[bytes, list[Any]]:
        """What has begun once ``data`` has come, and the messages that ended, or why there is none (``WireError``)."""
        ...


class Lines:
    """As between processes: each message is a line, with a check sum (``trackfield/wire/line.py``)."""

    def written(self, message: Any) -> bytes:
        """See ``Ways``."""
        return line.framed(encode(message))

    def heard(self, begun: bytes, data: bytes) -> tuple[bytes, list[Any]]:
        """See ``Ways``."""
        begun, lines = line.split(begun, data)
        return begun, [_message(one) for one in lines]


class Packets:
    """Packets of VISCA and nothing else: the device is a camera that knows no frames."""

    def written(self, message: Any) -> bytes:
        """See ``Ways``."""
        packet = message.packet if isinstance(message, Visca) else b""
        if not visca.is_packet(packet):
            raise WireError("visca", f"{packet.hex(' ') or 'nothing'} is no packet")
        return packet

    def heard(self, begun: bytes, data: bytes) -> tuple[bytes, list[Any]]:
        """See ``Ways``."""
        found = visca.split(begun, data)
        noise = [WireError("visca", "what ends with FFh is no packet")] * found.noise
        return found.begun, [*noise, *map(Visca, found.packets)]


class Bridge:
    """A role that writes what ``peer`` sends to it to its port, and sends what comes from there to ``peer``.

    ``kinds`` are the names of the messages that ``peer`` sends, ``modules`` those in which kinds of message are that
    are not Trackfield's own. It knows nothing of the messages: a device may send any. With ``bare`` they are packets
    of VISCA alone. Lines that carry none, and packets that are none, are dropped, and counted in a note. ``silent``
    are the media that its process has besides the line: no device is there.
    """

    def __init__(
        self,
        *,
        peer: str,
        kinds: Collection[str] = (),
        modules: Collection[str] = (),
        silent: Collection[Medium] = (),
        bare: bool = False,
    ) -> None:
        self.peer, self.kinds, self.silent = peer, frozenset(kinds), tuple(silent)
        self.ways: Ways = Packets() if bare else Lines()
        for name in modules:
            import_module(name)

    def begin(self) -> Heard:
        """Nothing has come."""
        return Heard()

    def handle(self, state: Heard, event: Event) -> tuple[Heard, tuple[Effect, ...]]:
        """See ``Role``."""
        match event:
            case Started():
                return state, tuple(Radio(False, medium) for medium in self.silent)
            case Received(_, message, self.peer):
                try:
                    return state, (Write(PORT, self.ways.written(message)),)
                except WireError as error:
                    return state, (Ignored(error.reason),)
            case PortRead(now, _, data):
                return self._read(state, now, data)
            case Timer():
                said = f"{state.dropped} lines from the device dropped, the last of them: {plain(state.why)}"
                return Heard(state.begun), (Note(said),)
        return state, (Ignored("unexpected"),)

    def _read(self, state: Heard, now: int, data: bytes) -> tuple[Heard, tuple[Effect, ...]]:
        """What a device sent: whole lines, parts of them, noise."""
        begun, found = self.ways.heard(state.begun, data)
        sends = tuple(Send(one, self.peer, "serial") for one in found if not isinstance(one, WireError))
        state, told = _dropped(replace(state, begun=begun), now, [one for one in found if isinstance(one, WireError)])
        return state, (*sends, *told)


def _message(one: bytes) -> Any:
    """What a line carries, or why nothing (``WireError``)."""
    try:
        return decode(line.unframed(one))
    except WireError as error:
        return error


def _dropped(state: Heard, now: int, errors: list[WireError]) -> tuple[Heard, tuple[Effect, ...]]:
    """With these counted, which are told a while after the first of them."""
    if not errors:
        return state, ()
    after = replace(state, dropped=state.dropped + len(errors), why=str(errors[-1]))
    return after, () if state.dropped else (SetTimer("dropped", now + TELL_NS),)
