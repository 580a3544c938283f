"""What becomes of a frame on the air: a pure function of the frame and the seed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import log
from typing import Final, Protocol

from trackfield.draw import uniform

MIN_DELAY_NS: Final = 1_000_000
"""Every frame takes at least 1 ms, so that a cause precedes its effect."""
FIELD: Final = "field"
"""The medium whose draws are keyed without its name."""

FrameKey = tuple[str, str, str, *tuple[str | int, ...]]
"""What draws for a frame are keyed by: src, dst, kind, sent_ns, copy, and its medium unless that is ``FIELD``."""


@dataclass(frozen=True, slots=True)
class Fate:
    """``cause`` says why the frame is lost (``radio``), None if it arrives ``delay_ns`` after it was sent.

    What it cost: ``attempts`` transmissions by the sender, over all fragments and repeats, of together
    ``bytes_on_air`` in ``air_ns``, and ``ack_bytes`` sent back by the hearer in ``ack_air_ns``. The sender's radio is
    taken for ``busy_ns`` from ``sent_ns`` on: by its way to the channel, by sending, by waiting for acknowledgements.
    Bytes and times are 0 where a model knows no radio.
    """

    cause: str | None
    delay_ns: int = 0
    attempts: int = 1
    bytes_on_air: int = 0
    ack_bytes: int = 0
    busy_ns: int = 0
    air_ns: int = 0
    ack_air_ns: int = 0


LOST: Final = Fate("radio")


def lost(fate: Fate, cause: str) -> Fate:
    """The fate of a frame that its hearer could not hear: its sender spends what it would have spent."""
    return replace(fate, cause=cause, delay_ns=0, ack_bytes=0, ack_air_ns=0)


class Link(Protocol):
    """A link model. Equal arguments have equal fates, in any process and in any order of asking."""

    def fate(
        self,
        src: str,
        dst: str,
        kind: str,
        sent_ns: int,
        copy: int,
        size: int,
        broadcast: bool = False,
        medium: str = FIELD,
    ) -> Fate:
        """The fate of a frame from ``src`` to ``dst``, sent at ``sent_ns`` (true time).

        ``copy`` tells frames of one kind and instant apart; ``size`` is the payload's, in bytes. A ``broadcast``
        has a fate per hearer, and is never acknowledged; what it costs its sender is the same for every hearer, and
        for one whose place is not known: its sender asks about ``*``. Whatever is drawn, for a frame or for a pair of
        processes, is drawn anew for each ``medium``.
        """
        ...

    def reception(self, src: str, dst: str, size: int, kind: str | None = None, at_ns: int = 0) -> float:
        """The expected share of addressed frames with payloads of ``size`` bytes that arrive, in a long run.

        ``kind`` matters where kinds are acknowledged differently; None is one that is not mentioned there. Who moves
        is where it is at ``at_ns``. The medium is ``FIELD``.
        """
        ...


def of_medium(medium: str) -> tuple[str, ...]:
    """What the key of a draw for a link ends with, so that each medium has draws of its own."""
    return () if medium == FIELD else (medium,)


def frame_key(src: str, dst: str, kind: str, sent_ns: int, copy: int, medium: str) -> FrameKey:
    """What the draws of this frame are keyed by."""
    key = (src, dst, kind, sent_ns, copy)
    return key if medium == FIELD else (*key, medium)


def delay(milliseconds: float) -> int:
    """A delay in whole ns, at least the minimum."""
    return max(MIN_DELAY_NS, round(milliseconds * 1e6))


def exponential(mean: float, seed: int, *key: str | int) -> float:
    """A keyed draw from the exponential distribution, in the unit of ``mean``."""
    return -mean * log(uniform(seed, *key))


def check_share(name: str, value: float) -> None:
    """Raise ``ValueError`` unless 0 <= value <= 1."""
    if not 0 <= value <= 1:
        raise ValueError(f"{name}: {value} is not a share between 0 and 1")


def check_positive(name: str, value: float, *, zero: bool = False) -> None:
    """Raise ``ValueError`` unless the value is finite and positive, or zero where that is allowed."""
    if not (0 < value < float("inf") or (zero and value == 0)):
        raise ValueError(f"{name}: {value} is not {'zero or ' if zero else ''}positive and finite")
