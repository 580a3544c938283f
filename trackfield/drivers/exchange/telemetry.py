"""The encoding of telemetry from a process to the recorder: MessagePack of ``[type, key, field, ...]``."""

from __future__ import annotations

from typing import Any, Final

import msgpack

from trackfield.drivers.engine.frames import Charge, Died, Overflowed, Queued, Refused, Told, Undone
from trackfield.role import Corrected, Listen, Note, Publish, Radio, State, Tell, Write

Telemetry = Told | Refused | Undone

_PLAIN: Final = {
    kind.__name__.lower(): kind for kind in (State, Radio, Listen, Note, Tell, Corrected, Write, Died, Charge, Queued)
}


def pack(output: Telemetry) -> bytes:
    """Encode one piece of telemetry."""
    match output:
        case Told(key, Publish(point)):
            body: tuple[Any, ...] = ("publish", key, *_fields(point))
        case Told(key, Overflowed(frame)):
            body = ("overflowed", key, *_fields(frame))
        case Told(key, effect):
            body = (type(effect).__name__.lower(), key, *_fields(effect))
        case Refused(key, reason):
            body = ("refused", key, reason)
        case Undone(key):
            body = ("undone", key)
    packed: bytes = msgpack.packb(body)
    return packed


def _fields(flat: object) -> tuple[Any, ...]:
    """The values of a dataclass without nested ones; ``astuple`` would load and copy more than a node needs."""
    return tuple(getattr(flat, name) for name in type(flat).__match_args__)  # type: ignore[attr-defined]
