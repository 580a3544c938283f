"""The fate of a frame on the air: a pure function of the frame and the seed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import log
from typing import Final, NamedTuple, Protocol

from trackfield.draw import uniform

MIN_DELAY_NS: Final = 1_000_000
"""Every frame takes at least 1 ms, so that a cause precedes its effect."""
FIELD: Final = "field"
"""The medium whose name is not part of the keys of draws."""

FrameKey = tuple[str, str, str, *tuple[str | int, ...]]
"""The key of a frame's draws: src, dst, kind, sent_ns, copy, and its medium unless that is ``FIELD``."""


class Transmission(NamedTuple):
    """A frame from ``src`` to ``dst``, sent at ``sent_ns`` (true time) on a ``medium``.

    ``copy`` tells frames of one kind and instant apart; ``size`` is the payload's, in bytes. A ``broadcast`` is for all
    in reach, ``dst`` is one of them, or ``*`` where only its cost is asked for. The preamble is ``preamble_ns`` longer
    than usual.
    """

    src: str
    dst: str
    kind: str
    sent_ns: int
    copy: int
    size: int
    broadcast: bool = False
    medium: str = FIELD
    preamble_ns: int = 0

    @property
    def key(self) -> FrameKey:
        """The key of its draws."""
        key = (self.src, self.dst, self.kind, self.sent_ns, self.copy)
        return key if self.medium == FIELD else (*key, self.medium)


@dataclass(frozen=True, slots=True)
class Fate:
    """``cause`` says why the frame is lost (``radio``), None if it arrives ``delay_ns`` after it was sent.

    Its cost: ``attempts`` transmissions by the sender, over all fragments and repeats, of ``bytes_on_air`` in total in
    ``air_ns``, and ``ack_bytes`` sent back by the receiver in ``ack_air_ns``. The sender's radio is occupied for
    ``busy_ns`` from ``sent_ns`` on: by channel access, sending, and waiting for acknowledgements. Bytes and times are 0
    in models without a radio.

    What its receiver must hear of it began ``span_ns`` before it arrived.
    """

    cause: str | None
    delay_ns: int = 0
    attempts: int = 1
    bytes_on_air: int = 0
    ack_bytes: int = 0
    busy_ns: int = 0
    air_ns: int = 0
    ack_air_ns: int = 0
    span_ns: int = 0


LOST: Final = Fate("radio")


def lost(fate: Fate, cause: str) -> Fate:
    """The fate of a frame that does not reach its receiver: its sender spends the same energy as otherwise."""
    return replace(fate, cause=cause, delay_ns=0, ack_bytes=0, ack_air_ns=0, span_ns=0)


class Link(Protocol):
    """A link model. Equal arguments have equal fates, in any process and in any order of calls."""

    def fate(self, frame: Transmission) -> Fate:
        """The fate of a frame.

        A broadcast has a fate per receiver, and is never acknowledged; its cost for the sender is the same for every
        receiver, and for one whose place is not known. All draws, for a frame or for a pair of processes, are
        independent for each medium.
        """
        ...

    def reception(
        self, src: str, dst: str, size: int, kind: str | None = None, at_ns: int = 0, medium: str = FIELD
    ) -> float:
        """The expected share of addressed frames with payloads of ``size`` bytes that arrive, in a long run.

        ``kind`` matters if kinds are acknowledged differently; None is a kind without its own setting. Places,
        and lines of a trace, are those at ``at_ns``.
        """
        ...


def of_medium(medium: str) -> tuple[str, ...]:
    """The end of the key of a link's draw, so that each medium has its own draws."""
    return () if medium == FIELD else (medium,)


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
