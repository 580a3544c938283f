"""A radio with path loss, constant shadowing per link (``shadowing``) and a reception curve (``reception``)."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from types import MappingProxyType
from typing import TypeVar

from trackfield.link.fate import FIELD, Fate, frame_key
from trackfield.link.places import Places, moves
from trackfield.link.radios import RADIOS, Radio
from trackfield.link.shadowing import CHANNELS
from trackfield.link.transfer import Transfer

T = TypeVar("T")


class LognormalPrr:
    """``radio`` and ``channel`` are names in ``RADIOS`` and ``CHANNELS``, ``sf`` is LoRa's spreading factor.

    Parameters that are None take the radio's value. A frame from or to a process of unknown place is out of range.
    """

    def __init__(
        self,
        seed: int,
        places: Places,
        radio: str = "802154-20dbm",
        channel: str | None = None,
        tx_dbm: float | None = None,
        noise_dbm: float | None = None,
        sf: int | None = None,
        busy: float = 0.0,
        ack: int | None = None,
        acks: Mapping[str, int] = MappingProxyType({}),
    ) -> None:
        self.radio = _radio(radio, 9 if sf is None else sf)
        self.channel = _named("channel", self.radio.channel if channel is None else channel, CHANNELS)
        self.tx_dbm = self.radio.tx_dbm if tx_dbm is None else tx_dbm
        self.noise_dbm = self.radio.noise_dbm if noise_dbm is None else noise_dbm
        self._seed, self._places = seed, places
        self._transfer = Transfer(seed, self.radio, busy, self.radio.ack if ack is None else ack, acks)
        self._moving = frozenset(id for id, place in places.items() if moves(place))
        # Cache for links whose ends do not move: a few entries per link in use.
        self._prr: dict[tuple[str, str, int, str], float] = {}

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
        """See ``Link.fate``."""
        there, back = (partial(self.prr, *ends, at_ns=sent_ns, medium=medium) for ends in ((src, dst), (dst, src)))
        frame = frame_key(src, dst, kind, sent_ns, copy, medium)
        return self._transfer.fate(frame, size, broadcast, there, back)

    def reception(self, src: str, dst: str, size: int, kind: str | None = None, at_ns: int = 0) -> float:
        """See ``Link.reception``."""
        return self._transfer.reception(size, kind, partial(self.prr, src, dst, at_ns=at_ns))

    def snr_db(self, src: str, dst: str, at_ns: int = 0, medium: str = FIELD) -> float:
        """The signal-to-noise ratio of the link in dB. Raises ``KeyError`` for one whose place is not known."""
        loss_db = self.channel.loss_db(self._seed, self._places, src, dst, at_ns, medium)
        return self.tx_dbm - loss_db - self.noise_dbm

    def prr(self, src: str, dst: str, frame_bytes: int, at_ns: int = 0, medium: str = FIELD) -> float:
        """The share of single frames of ``frame_bytes`` on the air that are received."""
        if src not in self._places or dst not in self._places:
            return 0.0
        if src in self._moving or dst in self._moving:
            return self.radio.prr(self.snr_db(src, dst, at_ns, medium), frame_bytes)
        key = (src, dst, frame_bytes, medium)
        if key not in self._prr:
            self._prr[key] = self.radio.prr(self.snr_db(src, dst, medium=medium), frame_bytes)
        return self._prr[key]


def _named(what: str, name: str, table: Mapping[str, T]) -> T:
    if name not in table:
        raise ValueError(f"{what} {name!r} is not one of {', '.join(table)}")
    return table[name]


def _radio(name: str, sf: int) -> Radio:
    if not 7 <= sf <= 12:
        raise ValueError(f"sf: {sf} is not a spreading factor from 7 to 12")
    return _named("radio", name, RADIOS)(sf)
