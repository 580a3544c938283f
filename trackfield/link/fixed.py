"""Every frame lost with the same probability, and delivered after the same delay."""

from __future__ import annotations

from dataclasses import dataclass

from trackfield.draw import uniform
from trackfield.link.fate import FIELD, LOST, Fate, Transmission, check_positive, check_share, delay


@dataclass(frozen=True)
class Fixed:
    """Independent losses with probability ``loss``, a constant delay. Without parameters: the ideal link."""

    seed: int
    loss: float = 0.0
    delay_ms: float = 1.0

    def __post_init__(self) -> None:
        check_share("loss", self.loss)
        check_positive("delay_ms", self.delay_ms, zero=True)

    def fate(self, frame: Transmission) -> Fate:
        """See ``Link.fate``."""
        if self.loss and uniform(self.seed, "loss", *frame.key) < self.loss:
            return LOST
        return Fate(None, delay(self.delay_ms))

    def reception(
        self, src: str, dst: str, size: int, kind: str | None = None, at_ns: int = 0, medium: str = FIELD
    ) -> float:
        """See ``Link.reception``."""
        return 1 - self.loss
