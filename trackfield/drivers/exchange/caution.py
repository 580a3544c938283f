"""How long a process waits before it handles what is due, as frames that come before it may be on their way still.

To go on at once is right as long as frames come in time. If they come late, what was handled is undone again and again,
and so is what peers made of it; a machine that is behind then spends the time in which it could catch up. So after
something came late, a process lets as much time pass before it handles anything, and ever less while nothing does. To
wait for longer than things are late would make them later: peers wait for each other.
"""

from __future__ import annotations

from typing import Final

HALF_NS: Final = 100_000_000
"""Caution is down to a half after so long without anything late (wall time)."""
MOST_NS: Final = 4_000_000_000
LEAST_NS: Final = 100_000


class Caution:
    """Learns from how late things come (ns of wall time)."""

    def __init__(self) -> None:
        self._wait_ns, self._since_ns = 0, 0

    def learn(self, late_ns: int, now_ns: int) -> None:
        """Something came so late."""
        self._wait_ns, self._since_ns = min(max(late_ns, self.at(now_ns)), MOST_NS), now_ns

    def at(self, now_ns: int) -> int:
        """How long to wait, now."""
        if not self._wait_ns:
            return 0
        halves: float = max(now_ns - self._since_ns, 0) / HALF_NS
        wait = round(self._wait_ns / 2**halves)
        if wait < LEAST_NS:
            self._wait_ns = 0
        return wait
