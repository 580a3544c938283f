"""The messages beyond a gateway: fixes on their way to a camera, and orders to remote processes; docs/wire.md.

On the backbone every process has an address. What a gateway lets through of the field, where data have names, travels
there as a numbered *item*, which its receiver acknowledges.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

from trackfield.wire.registry import Blob, Scaled, kind

ITEMS: Final = 65536
"""Items, captures, orders and carried messages are numbered modulo this."""
RUNNING: Final = 1
STOPPED: Final = 2
STATUS: Final = 0
START: Final = 1
STOP: Final = 2
VERBS: Final = ("status", "start", "stop")
"""What an order may ask for, by its number."""
ANSWERS: Final = ("ok", "refused", "unknown")
"""How it may be answered, by its number."""
MAC_BYTES: Final = 8
_ID: Final = Blob(32, "id, ASCII")
_NUMBER: Final = Scaled(0, ITEMS - 1, unit="number, cyclic")
_ADDRESS: Final = Scaled(1, 7, unit="address of the camera")
_PLACE: Final = Scaled(-1_000_000, 1_000_000, 0.1, "m")
_CLASS: Final = Scaled(0, 255, unit="class of data")
_MAC: Final = Blob(MAC_BYTES, "HMAC-SHA256, its first bytes")


@kind(70, "carried")
@dataclass(frozen=True, slots=True)
class Carried:
    """A message on its way over several hops of the backbone: from ``origin``, for ``destination``, after ``hops``.

    ``number`` counts what the origin sent in this way. ``message`` is the payload.
    """

    origin: Annotated[bytes, _ID]
    destination: Annotated[bytes, _ID]
    number: Annotated[int, _NUMBER]
    hops: Annotated[int, Scaled(0, 255, unit="hops")]
    message: Annotated[bytes, Blob(1400, "payload")]


@kind(71, "item")
@dataclass(frozen=True, slots=True)
class Item:
    """What a gateway lets through: a message of ``origin`` in the field, of the class ``task``.

    The gateway sends the same ``number`` again until it is acknowledged; ``life`` tells its lives apart. ``message`` is
    the payload.
    """

    number: Annotated[int, _NUMBER]
    life: Annotated[int, Scaled(0, 65535, unit="step in which the gateway's life began")]
    task: Annotated[int, _CLASS]
    origin: Annotated[bytes, _ID]
    message: Annotated[bytes, Blob(1200, "payload")]


@kind(72, "item-ack")
@dataclass(frozen=True, slots=True)
class ItemAck:
    """The receiver has this item."""

    number: Annotated[int, _NUMBER]
    life: Annotated[int, Scaled(0, 65535, unit="step in which the gateway's life began")]


@kind(73, "subscribe")
@dataclass(frozen=True, slots=True)
class Subscribe:
    """The sender wants items of the class ``task`` from within ``radius_m`` of a place, for ``lasts_s``; 0: no more.

    A gateway makes an interest of it.
    """

    task: Annotated[int, _CLASS]
    x_m: Annotated[float, _PLACE]
    y_m: Annotated[float, _PLACE]
    radius_m: Annotated[float, Scaled(0, 1_000_000, 0.1, "m")]
    lasts_s: Annotated[float, Scaled(0, 6553.5, 0.1, "s")]


@kind(74, "capture")
@dataclass(frozen=True, slots=True)
class Capture:
    """Camera control wants video for ``lasts_s`` from now on, of the shot ``number``; 0 s: no more of it."""

    number: Annotated[int, _NUMBER]
    lasts_s: Annotated[float, Scaled(0, 655.35, 0.01, "s")]


@kind(75, "captured")
@dataclass(frozen=True, slots=True)
class Captured:
    """The video of the shot ``number`` is over, and has so many ``frames``."""

    number: Annotated[int, _NUMBER]
    frames: Annotated[int, Scaled(0, 65535, unit="frames")]


@kind(76, "visca", bare=True)
@dataclass(frozen=True, slots=True)
class Visca:
    """A packet of Sony's VISCA, 3 to 16 bytes of which only the last is FFh; on a serial line these bytes alone."""

    packet: Annotated[bytes, Blob(16, "packet")]


@kind(77, "order")
@dataclass(frozen=True, slots=True)
class Order:
    """System control orders a process (``VERBS``) to say how it is, to start or to stop.

    ``number`` grows with each order to this process. ``mac`` authenticates it by the key of the run
    (``trackfield/protocols/orders.py``).
    """

    number: Annotated[int, _NUMBER]
    verb: Annotated[int, Scaled(0, 255, unit="verb")]
    mac: Annotated[bytes, _MAC]


@kind(78, "order-reply")
@dataclass(frozen=True, slots=True)
class OrderReply:
    """The answer (``ANSWERS``) to the order with this number; ``state`` is 1 if the process runs, 2 if it is stopped.

    ``refused`` counts the orders that it refused in this life.
    """

    number: Annotated[int, _NUMBER]
    answer: Annotated[int, Scaled(0, 255, unit="answer")]
    state: Annotated[int, Scaled(0, 255, unit="state")]
    refused: Annotated[int, Scaled(0, 65535, unit="orders")]
    mac: Annotated[bytes, _MAC]
