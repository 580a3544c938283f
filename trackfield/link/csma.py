"""Access to the channel by unslotted CSMA-CA (IEEE 802.15.4-2006, 7.5.1.4)."""

from __future__ import annotations

from dataclasses import dataclass

from trackfield.link.access import Draw


@dataclass(frozen=True, slots=True)
class Csma:
    """A random number of back-off units, a look at the channel (CCA), and again if it was busy, ``tries`` times.

    The number is below 2^BE; BE grows by one with each try, from ``be_min`` to ``be_max``. The channel is found busy
    with the same probability each time. ``turnaround_ns`` is the radio's switching time from listening to sending.
    """

    unit_ns: int = 320_000
    be_min: int = 3
    be_max: int = 5
    tries: int = 5
    cca_ns: int = 128_000
    turnaround_ns: int = 192_000

    @property
    def blind_ns(self) -> int:
        """See ``Access.blind_ns``: it listens until it turns round."""
        return self.turnaround_ns

    def wait_ns(self, attempt: int, busy: float, draw: Draw) -> tuple[int, bool]:
        """See ``Access.wait_ns``."""
        waited = 0
        for k in range(self.tries):
            units = int(draw("backoff", k) * 2 ** min(self.be_min + k, self.be_max))
            waited += units * self.unit_ns + self.cca_ns
            if draw("cca", k) >= busy:
                return waited + self.turnaround_ns, True
        return waited, False

    def granted(self, busy: float) -> float:
        """See ``Access.granted``."""
        return 1 - busy**self.tries
