"""Frames as they arrive: collected from Zenoh's threads, and taken apart."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from functools import lru_cache
from threading import Event, Thread
from typing import Any, Final

import zenoh
from zenoh.handlers import FifoChannel

from trackfield.drivers.engine.frames import Frame
from trackfield.role import NEIGHBOURHOOD
from trackfield.wire.codec import MAX_BYTES
from trackfield.wire.envelope import Envelope
from trackfield.wire.error import WireError
from trackfield.wire.keys import parse
from trackfield.wire.registry import check_size

EARLY_NS: Final = 50_000_000
"""How far ahead (wall time) the clock of a sender may be; frames leave when they say that they do."""
CHANNEL: Final = 100_000
"""Samples that wait in a channel before Zenoh's thread would block."""

_parsed = lru_cache(maxsize=10_000)(parse)
"""Cached: a run uses few keys, again and again."""

Inbox = deque[tuple[int, zenoh.Sample]]
"""Samples and when (the run's clock, ns) they arrived."""


def take_in(
    session: zenoh.Session, key: str, inbox: Inbox, wake: Event, now_ns: Callable[[], int] = time.monotonic_ns
) -> Any:
    """Subscribe for a process that computes for long at a time; returns the subscriber. ``now_ns`` is the run's clock.

    Meanwhile Zenoh's thread would have to wait for Python at every sample, and the router would drop the samples queued
    behind it. So it fills a channel of its own, and a thread here empties that at once whenever it runs.
    """
    subscriber = session.declare_subscriber(key, FifoChannel(CHANNEL))

    def empty() -> None:
        try:
            while True:
                sample: zenoh.Sample | None = subscriber.recv()
                while sample is not None:
                    inbox.append((now_ns(), sample))
                    sample = subscriber.try_recv()
                wake.set()
        except zenoh.ZError:
            return  # the session was closed

    Thread(target=empty, name=key, daemon=True).start()
    return subscriber


def no_stamp() -> Envelope:
    """For samples that must have an envelope. Raises ``WireError`` (``envelope``)."""
    raise WireError("envelope", "there is none")


def frame_in(
    key: str, payload: bytes, attachment: bytes | None, stamp: Callable[[], Envelope] = no_stamp
) -> tuple[Frame, Envelope, str]:
    """The frame in a sample, its envelope and its cell (of a broadcast); ``stamp`` makes an envelope if it has none.

    Without a payload it takes a frame back. Raises ``WireError``, for a payload that is too long before anything else
    is done with it.
    """
    if len(payload) > MAX_BYTES:
        raise WireError("size", f"{len(payload)} bytes, at most {MAX_BYTES}")
    a = _parsed(key)
    check_size(a.kind, len(payload))
    e = stamp() if attachment is None else Envelope.unpack(attachment)
    to = a.to or NEIGHBOURHOOD
    frame = Frame(a.src, e.incarnation, a.kind, e.sent_ns, e.copy, to, a.medium, payload, e.preamble_ns)
    return frame, e, a.cell or ""


def bytes_of(sample: zenoh.Sample) -> tuple[str, bytes, bytes | None]:
    """Key, payload and attachment of a sample."""
    attachment = sample.attachment
    return str(sample.key_expr), sample.payload.to_bytes(), attachment.to_bytes() if attachment else None
