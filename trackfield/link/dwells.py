"""Links that are good or bad for a while: the two-state channel of Gilbert (1960) and Elliott (1963), over time.

Each directed link of a medium is good or bad for exponentially distributed dwell times. Dwell k of a link is drawn by
its number, so the channel's states do not depend on the frames that are asked about. The channel starts in the
stationary distribution, P(bad) = bad_s / (good_s + bad_s), and as an exponential dwell has no memory, the first one is
distributed like all others.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from trackfield.draw import uniform
from trackfield.link.fate import FIELD, check_positive, exponential, of_medium


@dataclass(frozen=True)
class Dwells:
    """Mean dwell times ``good_s`` and ``bad_s``. Those with another ``purpose`` (part of all keys) are independent."""

    seed: int
    good_s: float
    bad_s: float
    purpose: tuple[str, ...] = ()
    # The dwell that each link was last asked about: (number, begin, end, whether dwell 0 is bad). One entry
    # per link in use, however long the run; only a starting point for the search, so it changes no answer.
    _last: dict[tuple[str, ...], tuple[int, int, int, bool]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def __post_init__(self) -> None:
        for name in ("good_s", "bad_s"):
            check_positive(name, getattr(self, name))

    @property
    def share_bad(self) -> float:
        """The share of the time in which a link is bad."""
        return self.bad_s / (self.good_s + self.bad_s)

    def bad(self, src: str, dst: str, at_ns: int, medium: str = FIELD) -> bool:
        """Whether the link from ``src`` to ``dst`` is in its bad state at ``at_ns``."""
        link = (*self.purpose, src, dst, *of_medium(medium))
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
        starts_bad = uniform(self.seed, "burst", *link) < self.share_bad
        return 0, 0, self._dwell(link, 0, starts_bad), starts_bad

    def _dwell(self, link: tuple[str, ...], k: int, starts_bad: bool) -> int:
        mean = self.bad_s if starts_bad ^ bool(k % 2) else self.good_s
        return max(1, round(exponential(mean * 1e9, self.seed, "dwell", *link, k)))
