"""A process's own clock: true time, shifted and stretched, in exact integers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

_NS: Final = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Clock:
    """Shows ``offset_ns`` at the start of the run and gains ``drift_ppb`` ns in each second of true time."""

    offset_ns: int = 0
    drift_ppb: int = 0

    def __post_init__(self) -> None:
        if self.drift_ppb <= -_NS:
            raise ValueError(f"drift_ppb: {self.drift_ppb} stops the clock or turns it back")

    def jumped(self, by_ns: int) -> Clock:
        """The same, put forward."""
        return Clock(self.offset_ns + by_ns, self.drift_ppb)

    def local(self, true_ns: int) -> int:
        """What the clock shows at a true time: floor(true * (1 + drift)) + offset; never decreasing."""
        return true_ns * (_NS + self.drift_ppb) // _NS + self.offset_ns

    def true(self, local_ns: int) -> int:
        """The first true time (ns) at which the clock shows ``local_ns`` or more."""
        return -(-(local_ns - self.offset_ns) * _NS // (_NS + self.drift_ppb))
