"""Access to the channel by the distributed coordination function of IEEE 802.11 (1999, 9.2)."""

from __future__ import annotations

from dataclasses import dataclass

from trackfield.link.access import Draw


@dataclass(frozen=True, slots=True)
class Dcf:
    """DIFS, then a random number of slots below the contention window, which doubles with each repeat.

    The slot counter stops while the channel is busy, so it takes 1 / (1 - busy) times as long in the mean: single
    interruptions are not drawn. The figures are those of 802.11b.
    """

    slot_ns: int = 20_000
    difs_ns: int = 50_000
    window_min: int = 32
    window_max: int = 1024

    @property
    def blind_ns(self) -> int:
        """See ``Access.blind_ns``: a slot is as long as that takes."""
        return self.slot_ns

    def wait_ns(self, attempt: int, busy: float, draw: Draw) -> tuple[int, bool]:
        """See ``Access.wait_ns``."""
        slots = int(draw("backoff", 0) * min(self.window_min << attempt, self.window_max))
        return self.difs_ns + round(slots * self.slot_ns / (1 - busy)), True

    def granted(self, busy: float) -> float:
        """See ``Access.granted``: it waits as long as it takes."""
        return 1.0
