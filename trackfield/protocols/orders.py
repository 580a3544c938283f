"""Orders to remote processes: how they are authenticated and numbered; docs/control.md.

A run has a key. The authentication of an order covers for whom it is, that of a reply also the order that it answers,
and to whom it goes: so no reply passes for the answer to another order, not even if somebody had it made by an order
of their own.
"""

from __future__ import annotations

from hashlib import sha256
from hmac import compare_digest, new
from struct import pack
from typing import Final

from trackfield.wire.outside import ITEMS, MAC_BYTES, Order, OrderReply

OK: Final = 0
REFUSED: Final = 1
UNKNOWN: Final = 2
"""The answers, by their places in ``ANSWERS``."""
TRIES: Final = 3
"""An order is sent so many times at most, as long as no answer comes."""


def order_for(id: str, number: int, verb: int, key: bytes) -> Order:
    """An order for this process, with its authentication."""
    return Order(number, verb, _mac(key, "order", id, pack(">HB", number, verb)))


def is_genuine(order: Order, id: str, key: bytes) -> bool:
    """Whether an order was made for this process, with this key."""
    return compare_digest(order.mac, order_for(id, order.number, order.verb, key).mac)


def reply_to(order: Order, id: str, to: str, said: tuple[int, int, int], key: bytes) -> OrderReply:
    """What process ``id`` replies to an order of ``to``; ``said`` are answer, state, and how many it refused."""
    ordered = pack(">HB", order.number, order.verb) + order.mac.ljust(MAC_BYTES, b"\0")
    mac = _mac(key, "reply", f"{id}\0{to}", ordered + pack(">BBH", *said))
    return OrderReply(order.number, *said, mac)


def answers(reply: OrderReply, order: Order, id: str, to: str, key: bytes) -> bool:
    """Whether this is what ``id`` replied to this order of ``to``."""
    expected = reply_to(order, id, to, (reply.answer, reply.state, reply.refused), key)
    return reply.number == order.number and compare_digest(reply.mac, expected.mac)


def following(number: int) -> int:
    """The number after this one; 0 is none."""
    return number % (ITEMS - 1) + 1


def is_newer(number: int, than: int) -> bool:
    """Whether a number comes after another one: it is less than half a cycle ahead."""
    return 0 < (number - than) % ITEMS < ITEMS // 2


def _mac(key: bytes, what: str, ids: str, numbers: bytes) -> bytes:
    return new(key, f"{what}\0{ids}\0".encode() + numbers, sha256).digest()[:MAC_BYTES]
