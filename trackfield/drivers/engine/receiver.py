"""When a receiver is open: on, off, or in windows that come round (Polastre et al. 2004, low-power listening).

Windows are a state, not timers: what is heard in them and how long they are open is computed when it is asked for, so a
process that sleeps between its windows costs no events.
"""

from __future__ import annotations

from typing import NamedTuple


class Windows(NamedTuple):
    """Open for ``open_ns`` from ``from_ns`` on, and again ``every_ns`` later, and so on (true time, ns).

    A frame is heard if a window is open for ``detect_ns`` of its preamble, which is ``spare_ns`` longer than that, and
    what a longer preamble adds. The receiver then stays open until the frame is over.
    """

    every_ns: int
    open_ns: int
    from_ns: int
    detect_ns: int = 0
    spare_ns: int = 0

    def catches(self, begin_ns: int, preamble_ns: int, since_ns: int) -> int | None:
        """From when on it hears a frame that begins then, in a window that opens at ``since_ns`` or later; or None.

        Its preamble is ``preamble_ns`` longer than usual.
        """
        latest = begin_ns + self.spare_ns + preamble_ns
        if latest < self.from_ns:
            return None
        opens = latest - (latest - self.from_ns) % self.every_ns
        if opens < since_ns or opens + self.open_ns < begin_ns + self.detect_ns:
            return None
        return max(opens, begin_ns)

    def within(self, from_ns: int, until_ns: int) -> int:
        """How long (ns) windows are open between two instants."""
        return self._before(until_ns) - self._before(from_ns)

    def spent_ns(self, since_ns: int, need: int, on: int, off: int) -> int | None:
        """When so much is spent from then on, at these rates (per ns) in windows and between them; None: never."""
        ahead_ns = max(self.from_ns - since_ns, 0)
        if need <= off * ahead_ns:
            return since_ns - -need // off
        t_ns, need = since_ns + ahead_ns, need - off * ahead_ns
        each = on * self.open_ns + off * (self.every_ns - self.open_ns)
        if not each:
            return None
        rounds, need = (need - 1) // each, (need - 1) % each + 1
        t_ns += rounds * self.every_ns
        while True:
            into = (t_ns - self.from_ns) % self.every_ns
            rate, lasts = (on, self.open_ns - into) if into < self.open_ns else (off, self.every_ns - into)
            if need <= rate * lasts:
                return t_ns - -need // rate
            t_ns, need = t_ns + lasts, need - rate * lasts

    def _before(self, t_ns: int) -> int:
        """How long windows were open before an instant."""
        if t_ns <= self.from_ns:
            return 0
        rounds, rest = divmod(t_ns - self.from_ns, self.every_ns)
        return rounds * self.open_ns + min(rest, self.open_ns)


Opening = bool | Windows
"""On, off, or in windows."""


def open_ns(opening: Opening, from_ns: int, until_ns: int) -> int:
    """How long (ns) a receiver is open between two instants, in order."""
    if isinstance(opening, Windows):
        return opening.within(from_ns, until_ns)
    return until_ns - from_ns if opening else 0


class Receiver(NamedTuple):
    """How a radio listens, since when (true time, ns), and how it did before; a change at t counts after t."""

    opening: Opening = True
    since_ns: int = -1
    before: Opening = True

    def changed(self, opening: Opening, t_ns: int) -> Receiver:
        """The same, changed at an instant."""
        return Receiver(opening, t_ns, self.before if self.since_ns == t_ns else self.opening)

    def hears_from(self, due_ns: int, span_ns: int = 0, preamble_ns: int = 0) -> int | None:
        """From when on it hears a frame that is over at ``due_ns`` after ``span_ns`` on air; None: it does not.

        One that is on must be so when the frame is over; in windows it is the frame's preamble that counts.
        """
        changed = due_ns > self.since_ns
        now, begin_ns = self.opening if changed else self.before, due_ns - span_ns
        if not isinstance(now, Windows):
            return begin_ns if now else None
        if changed and begin_ns <= self.since_ns and self.before is True:
            return begin_ns
        return now.catches(begin_ns, preamble_ns, self.since_ns if changed else -1)
