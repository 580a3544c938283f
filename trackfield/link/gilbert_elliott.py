"""Losses in bursts, and a random delay: the channel of Gilbert (1960) and Elliott (1963) (``dwells``).

The state at the instant of sending counts for a frame.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from trackfield.draw import uniform
from trackfield.link.dwells import Dwells
from trackfield.link.fate import (
    FIELD,
    LOST,
    Fate,
    Transmission,
    check_positive,
    check_share,
    delay,
    exponential,
)


@dataclass(frozen=True)
class GilbertElliott:
    """Mean dwell times ``good_s`` and ``bad_s``, the loss probability in each state, and a random delay.

    The delay is ``delay_ms`` plus an exponential of mean ``jitter_ms``, drawn for each frame.
    """

    seed: int
    good_s: float
    bad_s: float
    loss_good: float = 0.0
    loss_bad: float = 1.0
    delay_ms: float = 1.0
    jitter_ms: float = 0.0
    _dwells: Dwells = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_dwells", Dwells(self.seed, self.good_s, self.bad_s))
        for name in ("loss_good", "loss_bad"):
            check_share(name, getattr(self, name))
        for name in ("delay_ms", "jitter_ms"):
            check_positive(name, getattr(self, name), zero=True)

    def fate(self, frame: Transmission) -> Fate:
        """See ``Link.fate``."""
        bad = self._dwells.bad(frame.src, frame.dst, frame.sent_ns, frame.medium)
        if uniform(self.seed, "loss", *frame.key) < (self.loss_bad if bad else self.loss_good):
            return LOST
        jitter = exponential(self.jitter_ms, self.seed, "jitter", *frame.key) if self.jitter_ms else 0.0
        return Fate(None, delay(self.delay_ms + jitter))

    def reception(
        self, src: str, dst: str, size: int, kind: str | None = None, at_ns: int = 0, medium: str = FIELD
    ) -> float:
        """See ``Link.reception``."""
        bad = self._dwells.share_bad
        return 1 - bad * self.loss_bad - (1 - bad) * self.loss_good
