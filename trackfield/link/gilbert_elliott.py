"""Losses in bursts: the two-state channel of Gilbert (1960) and Elliott (1963), in continuous time.

Each directed link of a medium is good or bad for exponentially distributed dwell times. Dwell k of a link is drawn by
its number, so the channel's states do not depend on the frames that are asked about; the state at the instant of
sending counts for a frame. The channel starts in the stationary distribution, P(bad) = bad_s / (good_s + bad_s), and as
an exponential dwell has no memory, the first one is distributed like all others.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from trackfield.draw import uniform
from trackfield.link.fate import (
    FIELD,
    LOST,
    Fate,
    check_positive,
    check_share,
    delay,
    exponential,
    frame_key,
    of_medium,
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
    # The dwell that each link was last asked about: (number, begin, end, whether dwell 0 is bad). One entry
    # per link in use, however long the run; only a starting point for the search, so it changes no answer.
    _last: dict[tuple[str, ...], tuple[int, int, int, bool]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def __post_init__(self) -> None:
        for name in ("good_s", "bad_s"):
            check_positive(name, getattr(self, name))
        for name in ("loss_good", "loss_bad"):
            check_share(name, getattr(self, name))
        for name in ("delay_ms", "jitter_ms"):
            check_positive(name, getattr(self, name), zero=True)

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
        loss = self.loss_bad if self.bad(src, dst, sent_ns, medium) else self.loss_good
        if uniform(self.seed, "loss", *frame) < loss:
            return LOST
        jitter = exponential(self.jitter_ms, self.seed, "jitter", *frame) if self.jitter_ms else 0.0
        return Fate(None, delay(self.delay_ms + jitter))

    def reception(self, src: str, dst: str, size: int, kind: str | None = None, at_ns: int = 0) -> float:
        """See ``Link.reception``."""
        bad = self.bad_s / (self.good_s + self.bad_s)
        return 1 - bad * self.loss_bad - (1 - bad) * self.loss_good

    def bad(self, src: str, dst: str, at_ns: int, medium: str = FIELD) -> bool:
        """Whether the link from ``src`` to ``dst`` is in its bad state at ``at_ns``."""
        link = (src, dst, *of_medium(medium))
        k, begin, end, starts_bad = self._last.get(link) or self._first(link)
        while at_ns >= end:
            k += 1
            begin, end = end, end + self._dwell(link, k, starts_bad)
        while at_ns < begin:
            k -= 1
            begin, end = begin - self._dwell(link, k, starts_bad), begin
        self._last[link] = k, begin, end, starts_bad
        return starts_bad ^ bool(k % 2)

    def _first(self, link: tuple[str, ...]) -> tuple[int, int, int, bool]:
        share = self.bad_s / (self.good_s + self.bad_s)
        starts_bad = uniform(self.seed, "burst", *link) < share
        return 0, 0, self._dwell(link, 0, starts_bad), starts_bad

    def _dwell(self, link: tuple[str, ...], k: int, starts_bad: bool) -> int:
        mean = self.bad_s if starts_bad ^ bool(k % 2) else self.good_s
        return max(1, round(exponential(mean * 1e9, self.seed, "dwell", *link, k)))
