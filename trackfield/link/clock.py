"""A process's own clock: true time, shifted and stretched, in exact integers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import isqrt
from typing import Final, Self

_NS: Final = 1_000_000_000
_HOUR: Final = 3600 * _NS
_UNIT: Final = _NS * 2 * _HOUR
_LONG: Final = 8766 * _HOUR
"""A year: a ramp lasts this long, before the start and after; beyond that the drift stays constant."""


@dataclass(frozen=True, slots=True)
class Clock:
    """Shows ``offset_ns`` at the start of the run and gains ``drift_ppb`` ns in each second of true time.

    With a ramp, as from rising temperature, the drift itself grows by ``ramp_ppb_per_h`` in each hour of true time.
    Raises ``ValueError`` for a clock that stops or turns back (with a ramp: within a year of the start).
    """

    offset_ns: int = 0
    drift_ppb: int = 0
    ramp_ppb_per_h: int = 0

    def __post_init__(self) -> None:
        if self.drift_ppb <= -_NS:
            raise ValueError(f"drift_ppb: {self.drift_ppb} stops the clock or turns it back")
        if self._rate(-_LONG) <= 0 or self._rate(_LONG) <= 0:
            raise ValueError(f"ramp_ppb_per_h: {self.ramp_ppb_per_h} stops the clock or turns it back within a year")

    def local(self, true_ns: int) -> int:
        """What the clock shows at a true time; never decreasing.

        That is floor(true + drift * true + ramp * true^2 / 2) + offset.
        """
        if not self.ramp_ppb_per_h:
            return true_ns * (_NS + self.drift_ppb) // _NS + self.offset_ns
        return self._gained(true_ns) // _UNIT + self.offset_ns

    def true(self, local_ns: int) -> int:
        """The first true time (ns) at which the clock shows ``local_ns`` or more."""
        shown = local_ns - self.offset_ns
        if not self.ramp_ppb_per_h:
            return -(-shown * _NS // (_NS + self.drift_ppb))
        return self._reaching(shown * _UNIT)

    def jumped(self, by_ns: int) -> Self:
        """The clock after a jump: shows ``by_ns`` more at any time."""
        return replace(self, offset_ns=self.offset_ns + by_ns)

    # With a ramp: what the clock shows, without offset, in units of 1 / _UNIT ns, which makes it a whole number.
    # g(t) = (1 + drift) t + ramp t^2 / 2 up to a year from the start, and straight on from there.

    def _rate(self, true_ns: int) -> int:
        """g'(t), up to a year from the start; monotonic in t."""
        return (_NS + self.drift_ppb) * 2 * _HOUR + 2 * self.ramp_ppb_per_h * true_ns

    def _gained(self, true_ns: int) -> int:
        """g(t)."""
        t = min(max(true_ns, -_LONG), _LONG)
        return t * (self._rate(0) + self.ramp_ppb_per_h * t) + (true_ns - t) * self._rate(t)

    def _reaching(self, gained: int) -> int:
        """The first t with g(t) >= ``gained``."""
        for end, beyond in ((_LONG, gained > self._gained(_LONG)), (-_LONG, gained < self._gained(-_LONG))):
            if beyond:
                return end - (self._gained(end) - gained) // self._rate(end)
        # The root of ramp t^2 + rate t = gained; written so, it loses nothing however small the ramp. What isqrt cuts
        # off is far less than 1 in the sum, so the root is off by less than 1 ns.
        rate = self._rate(0)
        t = 2 * gained // (rate + isqrt(rate * rate + 4 * self.ramp_ppb_per_h * gained))
        while self._gained(t) < gained:
            t += 1
        while self._gained(t - 1) >= gained:
            t -= 1
        return t
