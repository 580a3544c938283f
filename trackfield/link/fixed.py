"""Every frame lost with the same probability, and delivered after the same delay."""

from __future__ import annotations

from dataclasses import dataclass

from trackfield.draw import uniform
from trackfield.link.fate import FIELD, LOST, Fate, check_positive, check_share, delay, frame_key


@dataclass(frozen=True)
class Fixed:
    """Independent losses with probability ``loss``, a constant delay. Without parameters: the ideal link."""

    seed: int
    loss: float = 0.0
    delay_ms: float = 1.0

    def __post_init__(self) -> None:
        check_share("loss", self.loss)
        check_positive("delay_ms", self.delay_ms, zero=True)

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
        frame = frame_key(src, dst, kind, sent_ns, copy, medium)
        if self.loss and uniform(self.seed, "loss", *frame) < self.loss:
            return LOST
        return Fate(None, delay(self.delay_ms))

    def reception(self, src: str, dst: str, size: int, kind: str | None = None, at_ns: int = 0) -> float:
        """See ``Link.reception``."""
        return 1 - self.loss
