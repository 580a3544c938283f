"""Any link without a radio, and more losses: a frame is sent once there, so each is lost or not."""

from __future__ import annotations

from dataclasses import dataclass

from trackfield.draw import uniform
from trackfield.link.fate import FIELD, Fate, Link, Transmission, check_share, lost


@dataclass(frozen=True, slots=True)
class Lossy:
    """``link``, but for a share ``extra_loss`` of what it delivers. With a radio, ``Transfer`` has the same."""

    seed: int
    link: Link
    extra_loss: float

    def __post_init__(self) -> None:
        check_share("extra_loss", self.extra_loss)

    def fate(self, frame: Transmission) -> Fate:
        """See ``Link.fate``; the sender spends the same energy for a lost frame."""
        fate = self.link.fate(frame)
        if fate.cause is None and uniform(self.seed, "extra loss", *frame.key) < self.extra_loss:
            return lost(fate, "radio")
        return fate

    def reception(
        self, src: str, dst: str, size: int, kind: str | None = None, at_ns: int = 0, medium: str = FIELD
    ) -> float:
        """See ``Link.reception``."""
        return (1 - self.extra_loss) * self.link.reception(src, dst, size, kind, at_ns, medium)
