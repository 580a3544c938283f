"""Any link with bursts of losses: whatever it delivers otherwise, for a while nothing gets through."""

from __future__ import annotations

from dataclasses import dataclass, field

from trackfield.link.dwells import Dwells
from trackfield.link.fate import FIELD, Fate, Link, Transmission, lost


@dataclass(frozen=True)
class Bursty:
    """``link``, but for bursts of ``burst_s`` seconds (mean) that take a share ``burst_loss`` of the time.

    Each direction of each link has its own. Raises ``ValueError`` unless the share is above 0 and below 1.
    """

    seed: int
    link: Link
    burst_loss: float
    burst_s: float
    _dwells: Dwells = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not 0 < self.burst_loss < 1:
            raise ValueError(f"burst_loss: {self.burst_loss} is not a share above 0 and below 1")
        good_s = self.burst_s * (1 - self.burst_loss) / self.burst_loss
        object.__setattr__(self, "_dwells", Dwells(self.seed, good_s, self.burst_s, ("bursts",)))

    def fate(self, frame: Transmission) -> Fate:
        """See ``Link.fate``; the sender spends the same energy for a lost frame."""
        fate = self.link.fate(frame)
        if fate.cause is None and self._dwells.bad(frame.src, frame.dst, frame.sent_ns, frame.medium):
            return lost(fate, "radio")
        return fate

    def reception(
        self, src: str, dst: str, size: int, kind: str | None = None, at_ns: int = 0, medium: str = FIELD
    ) -> float:
        """See ``Link.reception``."""
        return (1 - self.burst_loss) * self.link.reception(src, dst, size, kind, at_ns, medium)
