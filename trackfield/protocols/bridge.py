"""A bridge: in the place of a process, it lets a device at a serial line talk with the process at the other end."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from importlib import import_module
from typing import Final

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
from trackfield.wire import line
from trackfield.wire.codec import decode, encode
from trackfield.wire.error import WireError
from trackfield.wire.keys import Medium
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


class Bridge:
    """A role that writes what ``peer`` sends to it to its port, and sends what comes from there to ``peer``.

    ``kinds`` are the names of the messages that ``peer`` sends, ``modules`` those in which kinds of message are that
    are not Trackfield's own. It knows nothing of the messages: a device may send any. Lines that carry none are
    dropped, and counted in a note. ``silent`` are the media that its process has besides the line: no device is there.
    """

    def __init__(
        self,
        *,
        peer: str,
        kinds: Collection[str] = (),
        modules: Collection[str] = (),
        silent: Collection[Medium] = (),
    ) -> None:
        self.peer, self.kinds, self.silent = peer, frozenset(kinds), tuple(silent)
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
                return state, (Write(PORT, line.framed(encode(message))),)
            case PortRead(now, _, data):
                return self._read(state, now, data)
            case Timer():
                said = f"{state.dropped} lines from the device dropped, the last of them: {plain(state.why)}"
                return Heard(state.begun), (Note(said),)
        return state, (Ignored("unexpected"),)

    def _read(self, state: Heard, now: int, data: bytes) -> tuple[Heard, tuple[Effect, ...]]:
        """What a device sent: whole lines, parts of them, noise."""
        begun, lines = line.split(state.begun, data)
        state, silent = replace(state, begun=begun), not state.dropped
        effects: list[Effect] = []
        for one in lines:
            try:
                effects.append(Send(decode(line.unframed(one)), self.peer, "serial"))
            except WireError as error:
                state = replace(state, dropped=state.dropped + 1, why=str(error))
        if state.dropped and silent:
            effects.append(SetTimer("dropped", now + TELL_NS))
        return state, tuple(effects)
