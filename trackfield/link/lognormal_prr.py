"""A radio with path loss, constant shadowing per link (``shadowing``) and a reception curve (``reception``)."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cached_property, partial
from types import MappingProxyType
from typing import Final, TypeVar

from trackfield.link.fate import FIELD, Transmission
from trackfield.link.places import Places, moves
from trackfield.link.radios import RADIOS, Radio
from trackfield.link.shadowing import CHANNELS
from trackfield.link.transfer import ByRadio, Prr, Transfer

T = TypeVar("T")

FAR_SDS: Final = 3
"""A link is out of reach if even one so much better than the mean (standard deviations of shadowing) is too weak."""
LEAST_SHARE: Final = 0.01
"""A link that delivers less than this share of empty messages is no link."""
WEAKEST_DB: Final = 60.0
"""No radio receives a signal so far below the noise."""


class LognormalPrr(ByRadio):
    """``radio`` and ``channel`` are names in ``RADIOS`` and ``CHANNELS``, ``sf`` is LoRa's spreading factor.

    Parameters that are None take the radio's value, those of the path loss the channel's; ``tx_dbms`` are the transmit
    powers of those that have their own, by id. A frame from or to a process of unknown place is out of range.
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
        pl0_db: float | None = None,
        exponent: float | None = None,
        sigma_db: float | None = None,
        asymmetry_db: float | None = None,
        busy: float = 0.0,
        ack: int | None = None,
        acks: Mapping[str, int] = MappingProxyType({}),
        tx_dbms: Mapping[str, float] = MappingProxyType({}),
    ) -> None:
        own_radio = _radio(radio, 9 if sf is None else sf)
        self._transfer = Transfer(seed, own_radio, busy, own_radio.ack if ack is None else ack, acks)
        own = {"pl0_db": pl0_db, "exponent": exponent, "sigma_db": sigma_db, "asymmetry_db": asymmetry_db}
        named = _named("channel", self.radio.channel if channel is None else channel, CHANNELS)
        self.channel = replace(named, **{key: value for key, value in own.items() if value is not None})
        self.tx_dbm = self.radio.tx_dbm if tx_dbm is None else tx_dbm
        self.tx_dbms = tx_dbms
        self.noise_dbm = self.radio.noise_dbm if noise_dbm is None else noise_dbm
        self._seed, self._places = seed, places
        self._moving = frozenset(id for id, place in places.items() if moves(place))
        # Caches for links whose ends do not move, by sender: a few entries per link in use.
        self._levels_db: defaultdict[tuple[str, str], dict[str, float]] = defaultdict(dict)
        self._prr: defaultdict[tuple[str, int, str], dict[str, float]] = defaultdict(dict)

    def _prrs(self, frame: Transmission) -> tuple[Prr, Prr]:
        """See ``ByRadio``."""
        ends = (frame.src, frame.dst), (frame.dst, frame.src)
        there, back = (partial(self.prr, *two, at_ns=frame.sent_ns, medium=frame.medium) for two in ends)
        return there, back

    def reception(
        self, src: str, dst: str, size: int, kind: str | None = None, at_ns: int = 0, medium: str = FIELD
    ) -> float:
        """See ``Link.reception``."""
        return self._transfer.reception(size, kind, partial(self.prr, src, dst, at_ns=at_ns, medium=medium))

    @property
    def reach_m(self) -> float:
        """Beyond this distance all links are too weak, but for one in a thousand of those just beyond it."""
        return self._farthest_m(self._received)

    @property
    def signal_m(self) -> float:
        """The same for signals that disturb others, of ``least_db`` or more."""
        least_db = self.least_db
        return self._farthest_m(lambda snr_db: snr_db >= least_db)

    @cached_property
    def least_db(self) -> float:
        """The least signal-to-noise ratio (dB) that disturbs other frames: that of the noise, or the least at which the
        radio receives anything, where that is lower, as with LoRa.
        """
        low, high = -WEAKEST_DB, 0.0
        while high - low > 0.01:
            middle = (low + high) / 2
            low, high = (low, middle) if self._received(middle) else (middle, high)
        return high

    def _received(self, snr_db: float) -> bool:
        """Whether an empty message has a chance."""
        return self.radio.prr(snr_db, self.radio.overhead_bytes) >= LEAST_SHARE

    def _farthest_m(self, strong: Callable[[float], bool]) -> float:
        """Up to which distance (m) a signal is ``strong`` by its signal-to-noise ratio, even one of those that are
        shadowed the least.
        """
        loudest_dbm, spare_db = max([self.tx_dbm, *self.tx_dbms.values()]), FAR_SDS * self.channel.sd_db
        near, far = 0.0, 1.0

        def heard(at_m: float) -> bool:
            return strong(loudest_dbm - self.channel.mean_db(at_m) + spare_db - self.noise_dbm)

        while heard(far):
            near, far = far, 2 * far
        while far - near > 0.001 * far:
            middle = (near + far) / 2
            near, far = (middle, far) if heard(middle) else (near, middle)
        return far

    def snr_db(self, src: str, dst: str, at_ns: int = 0, medium: str = FIELD) -> float:
        """The signal-to-noise ratio of the link in dB. Raises ``KeyError`` for one whose place is not known."""
        loss_db = self.channel.loss_db(self._seed, self._places, src, dst, at_ns, medium)
        return self.tx_dbms.get(src, self.tx_dbm) - loss_db - self.noise_dbm

    def prr(self, src: str, dst: str, frame_bytes: int, at_ns: int = 0, medium: str = FIELD) -> float:
        """The share of single frames of ``frame_bytes`` on the air that are received."""
        known = self._prr[src, frame_bytes, medium]
        if dst in known:
            return known[dst]
        if src not in self._places or dst not in self._places:
            return 0.0
        if src in self._moving or dst in self._moving:
            return self.radio.prr(self.snr_db(src, dst, at_ns, medium), frame_bytes)
        levels = self._levels_db[src, medium]
        if dst not in levels:
            levels[dst] = self.snr_db(src, dst, medium=medium)
        known[dst] = self.radio.prr(levels[dst], frame_bytes)
        return known[dst]


def _named(what: str, name: str, table: Mapping[str, T]) -> T:
    if name not in table:
        raise ValueError(f"{what} {name!r} is not one of {', '.join(table)}")
    return table[name]


def _radio(name: str, sf: int) -> Radio:
    if not 7 <= sf <= 12:
        raise ValueError(f"sf: {sf} is not a spreading factor from 7 to 12")
    return _named("radio", name, RADIOS)(sf)
