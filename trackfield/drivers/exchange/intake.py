"""How samples come into a process: parsed once into a type, or refused by the one error of the wire, and counted."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final, TypeVar

import msgpack

from trackfield.drivers.exchange.inbox import bytes_of
from trackfield.drivers.exchange.seal import Seal
from trackfield.wire.error import WireError
from trackfield.words import plain, shortened

if TYPE_CHECKING:
    import zenoh

log = logging.getLogger(__name__)

LOGGED: Final = 5
"""So many refusals for one reason are logged; then the tenth, the hundredth and so on."""
SHOWN: Final = 100
"""Characters of a key or a message that are logged."""
MAX_PLAIN: Final = 64 * 2**20
"""The largest plain value (bytes) that is unpacked, such as what a process is told when it joins."""

T = TypeVar("T")


def read(parse: Callable[..., T], *arguments: Any) -> T:
    """What ``parse`` makes of these; whatever is wrong with them, the error is ``WireError``."""
    try:
        return parse(*arguments)
    except WireError:
        raise
    except (ValueError, TypeError, LookupError, AttributeError, ArithmeticError, RecursionError) as error:
        raise WireError("malformed", f"{type(error).__name__}: {error}") from None


def unpacked(data: bytes, limit: int = MAX_PLAIN) -> Any:
    """The value in MessagePack, with tuples for arrays. Raises ``WireError`` (``size``, ``malformed``)."""
    if len(data) > limit:
        raise WireError("size", f"{len(data)} bytes, at most {limit}")
    try:
        return msgpack.unpackb(data, use_list=False, strict_map_key=False)
    except (ValueError, TypeError, OverflowError, RecursionError, msgpack.UnpackException) as error:
        raise WireError("malformed", str(error)) from None


def opened(sample: zenoh.Sample, seal: Seal, limit: int = MAX_PLAIN) -> bytes:
    """The payload of an order or of telemetry. Raises ``WireError`` (``size``, ``seal``)."""
    if len(sample.payload) > limit:
        raise WireError("size", f"{len(sample.payload)} bytes, at most {limit}")
    key, payload, attachment = bytes_of(sample)
    seal.check(key, payload, attachment)
    return payload


def nanoseconds(data: bytes) -> int:
    """A time in decimal digits, as in orders; at most 63 bits. Raises ``WireError`` (``malformed``)."""
    if len(data) > 20 or not data.isdigit() or int(data) >= 2**63:
        raise WireError("malformed", "no time in ns")
    return int(data)


def begun(start_ns: int | None, order: bytes) -> int:
    """The start of a run by this order, if it has not started yet. Raises ``WireError`` (``order``) for another."""
    ordered_ns = nanoseconds(order)
    if start_ns not in (None, ordered_ns):
        raise WireError("order", "the run has started at another time")
    return ordered_ns


class Refusals:
    """How many samples were refused, by reason."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()

    @property
    def total(self) -> int:
        """All of them."""
        return self.counts.total()

    def add(self, key: object, error: WireError) -> None:
        """Count a sample that came on this key, and log it unless many were."""
        self.counts[error.reason] += 1
        count = self.counts[error.reason]
        if count <= LOGGED or str(count).strip("0") == "1":
            log.warning("refused a sample on %s: %s (no. %d)", printable(key), printable(error), count)


def printable(text: object, most: int = SHOWN) -> str:
    """A text that may be anything, for a log or a terminal: short, without control characters."""
    return plain(shortened(str(text), most))
