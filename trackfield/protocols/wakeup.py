"""Waking those who sleep: by preambles that no sleeper misses, or in windows that sender and sleeper agree on.

A sleeper's receiver is open for a short while every ``every_ns`` (``trackfield.role.Listen``). Who sends to it either

- makes the preamble as long as the interval, so that one window falls into it whenever it begins: preamble sampling
  (Polastre, Hill, Culler 2004, "Versatile low power media access for wireless sensor networks"), for which clocks need
  not be set; or
- sends when the sleeper's next window opens, by clocks that were set (``timesync``). These are off by no more than
  ``unsure_ns`` together: the preamble begins so much before the window, and is so long that it lasts until the window
  of a clock that is as much behind, and for the time in which it is detected.

The second costs the sender twice the uncertainty in place of the interval.
"""

from __future__ import annotations

from dataclasses import dataclass

from trackfield.role import Listen
from trackfield.wire.keys import Medium


@dataclass(frozen=True)
class Wakeup:
    """Windows of ``open_ns`` every ``every_ns``, the first at ``from_ns`` (time of the reference, ns).

    ``detect_ns`` and ``spare_ns`` belong to the radio, as in ``Listen``. ``unsure_ns`` is how far apart the clocks of
    sender and sleeper may be, with the time that the sender may wait for the channel; None: the windows are unknown to
    the sender.

    Raises ``ValueError`` for a window that is longer than the interval, or shorter than ``detect_ns``.
    """

    every_ns: int
    open_ns: int
    from_ns: int = 0
    detect_ns: int = 0
    spare_ns: int = 0
    unsure_ns: int | None = None
    medium: Medium = "field"

    def __post_init__(self) -> None:
        if not 0 < self.open_ns <= self.every_ns:
            raise ValueError(f"open_ns: {self.open_ns} is not from 1 to every_ns, which is {self.every_ns}")
        if self.open_ns < self.detect_ns:
            raise ValueError(f"open_ns: in {self.open_ns} ns no preamble is detected; that takes {self.detect_ns}")

    @property
    def preamble_ns(self) -> int:
        """By how much the sender makes its preamble longer (``Send.preamble_ns``)."""
        needed_ns = self.every_ns if self.unsure_ns is None else 2 * self.unsure_ns
        return max(needed_ns - self.spare_ns, 0)

    def listen(self, correction_ns: int = 0) -> Listen:
        """What the sleeper's receiver does, whose clock plus the correction is the reference's."""
        return Listen(
            self.every_ns, self.open_ns, self.from_ns - correction_ns, self.detect_ns, self.spare_ns, self.medium
        )

    def send_at(self, now: int, correction_ns: int = 0) -> int:
        """When the sender should send what is to be heard soonest: now, or before the next window, by its own clock."""
        if self.unsure_ns is None:
            return now
        rounds = -(-(now + correction_ns + self.unsure_ns - self.from_ns) // self.every_ns)
        return self.from_ns + max(rounds, 0) * self.every_ns - self.unsure_ns - correction_ns
