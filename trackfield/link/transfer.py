"""A frame's transfer by radio: fragments, channel access, repeats, acknowledgements, all within its fate."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple, Self

from trackfield.draw import uniform
from trackfield.link.fate import MIN_DELAY_NS, Fate, Transmission, check_share
from trackfield.link.radios import Radio

Prr = Callable[[int], float]
"""The share of frames received, by their bytes on the air."""


class OnAir(NamedTuple):
    """One transmission, [``begin_ns``, ``end_ns``) after its payload was sent: fragment number ``part``, or an
    ``answer``, an acknowledgement of it by the receiver. ``heard`` says whether the other end received it.
    """

    begin_ns: int
    end_ns: int
    part: int
    heard: bool
    answer: bool = False


@dataclass(frozen=True, slots=True)
class Transfer:
    """Sends payloads over a radio whose channel is busy for a share ``busy`` of the time.

    With ``ack`` = n a fragment is sent until an acknowledgement arrives, n times at most, and counts as arrived when
    its first acknowledgement is out; with 0 it is sent once. ``acks`` overrides ``ack`` for some kinds of
    message, by name. ``extra_loss`` is the share of all transmissions, acknowledgements included, that is lost
    besides. Fragments are sent one after the other; each has a fate of its own, and the payload arrives with the last
    one, if none is lost.
    """

    seed: int
    radio: Radio
    busy: float = 0.0
    ack: int = 0
    acks: Mapping[str, int] = field(default_factory=dict)
    extra_loss: float = 0.0

    def __post_init__(self) -> None:
        check_share("extra_loss", self.extra_loss)
        check_share("busy", self.busy)
        if self.busy == 1:
            raise ValueError("busy: a channel that is always busy carries nothing")
        for name, ack in {"ack": self.ack, **{f"acks.{kind}": ack for kind, ack in self.acks.items()}}.items():
            if ack < 0:
                raise ValueError(f"{name}: {ack} is negative")

    def tries(self, frame: Transmission) -> int:
        """How often each fragment of a frame is sent at most."""
        return max(self._acks(frame), 1)

    def _acks(self, frame: Transmission) -> int:
        """The ``ack`` of a frame."""
        return 0 if frame.broadcast else self.acks.get(frame.kind, self.ack)

    def on_air(self, frame: Transmission, there: Prr, back: Prr) -> tuple[OnAir, ...]:
        """The transmissions that make the fate of a payload, in order; see ``fate``."""
        seen: list[OnAir] = []
        self.fate(frame, there, back, seen)
        return tuple(seen)

    def fate(self, frame: Transmission, there: Prr, back: Prr, seen: list[OnAir] | None = None) -> Fate:
        """The fate of a payload; its transmissions are added to ``seen``.

        ``there`` is the share of frames received in the payload's direction, ``back`` in that of acknowledgements.
        """
        src, dst, kind, *which = key = frame.key
        # A broadcast is sent once for all its receivers, so they share its channel access.
        sender = (src, "*" if frame.broadcast else dst, kind, *which)
        ack = self._acks(frame)
        now, attempts, on_air, air, acks, arrived, begun = 0, 0, 0, 0, 0, True, 0
        passed = 1 - self.extra_loss
        for number, part in enumerate(self._frames(frame.size)):
            got, airtime = False, self.radio.airtime_ns(part) + frame.preamble_ns
            for attempt in range(max(ack, 1)):
                draw = partial(_draw, self.seed, sender, number, attempt)
                waited, granted = self.radio.access.wait_ns(attempt, self.busy, draw)
                now += waited
                if not granted:
                    break
                now += airtime
                attempts, on_air, air = attempts + 1, on_air + part, air + airtime
                heard = uniform(self.seed, "received", *key, number, attempt) < passed * there(part)
                if seen is not None:
                    seen.append(OnAir(now - airtime, now, number, heard))
                if heard and not got:
                    got, at = True, now + (self.radio.ack_ns if ack else 0)
                    begun = begun if number else now - airtime
                if not ack:
                    break
                acks += heard
                known = heard and uniform(self.seed, "ack", *key, number, attempt) < passed * back(self.radio.ack_bytes)
                if heard and seen is not None:
                    seen.append(OnAir(now + self.radio.turnaround_ns, now + self.radio.ack_ns, number, known, True))
                if known:
                    now += self.radio.ack_ns
                    break
                now += self.radio.patience_ns
            arrived = arrived and got
        ack_bytes, ack_air = self.radio.ack_bytes, self.radio.airtime_ns(self.radio.ack_bytes)
        cost = (attempts, on_air, acks * ack_bytes, now, air, acks * ack_air)
        if not arrived:
            return Fate("radio", 0, *cost)
        arrives = max(at, MIN_DELAY_NS)
        return Fate(None, arrives, *cost, span_ns=arrives - begun)

    def reception(self, size: int, kind: str | None, there: Prr) -> float:
        """The probability that an addressed payload arrives; ``kind`` None is one without an entry in ``acks``."""
        ack = self.ack if kind is None else self.acks.get(kind, self.ack)
        granted, whole = self.radio.access.granted(self.busy), 1.0
        for part in self._frames(size):
            share = (1 - self.extra_loss) * there(part)
            again = granted * (1 - share)
            whole *= granted * share * sum(again**i for i in range(max(ack, 1)))
        return whole

    def _frames(self, size: int) -> list[int]:
        """The frames of a payload, in bytes on the air."""
        most = self.radio.payload_bytes
        parts = [most] * (size // most) + ([size % most] if size % most or not size else [])
        return [part + self.radio.overhead_bytes for part in parts]


class ByRadio:
    """A link model whose payloads go by its ``_transfer``; it says how well frames are received (``_prrs``)."""

    _transfer: Transfer

    def lossier(self, extra_loss: float) -> Self:
        """The same model, with a share of all transmissions lost besides."""
        found = copy(self)
        object.__setattr__(found, "_transfer", replace(self._transfer, extra_loss=extra_loss))
        return found

    @property
    def radio(self) -> Radio:
        """Its radio."""
        return self._transfer.radio

    def fate(self, frame: Transmission) -> Fate:
        """See ``Link.fate``."""
        return self._transfer.fate(frame, *self._prrs(frame))

    def tries(self, frame: Transmission) -> int:
        """How often each fragment of a frame is sent at most."""
        return self._transfer.tries(frame)

    def on_air(self, frame: Transmission) -> tuple[OnAir, ...]:
        """The transmissions of which the fate of a frame is made."""
        return self._transfer.on_air(frame, *self._prrs(frame))

    def _prrs(self, frame: Transmission) -> tuple[Prr, Prr]:
        """The reception in the direction of a frame, and of its acknowledgements."""
        raise NotImplementedError


def _draw(seed: int, sender: tuple[str | int, ...], number: int, attempt: int, purpose: str, k: int) -> float:
    return uniform(seed, purpose, *sender, number, attempt, k)
