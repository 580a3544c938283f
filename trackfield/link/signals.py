"""What is on the air, whether it is for a process or not: the signals of a medium with a radio.

Fates are pure functions of one frame, so no frame disturbs another. What would have disturbed it can be computed from
these signals afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

from trackfield.link.bursty import Bursty
from trackfield.link.csma154 import Csma154
from trackfield.link.fate import Link, Transmission
from trackfield.link.lognormal_prr import LEAST_SHARE, LognormalPrr
from trackfield.link.lossy import Lossy
from trackfield.link.measured import Measured
from trackfield.link.media import Media
from trackfield.link.partitioned import Partitioned
from trackfield.link.radios import Radio
from trackfield.link.ranged import Ranged
from trackfield.link.transfer import OnAir


@dataclass(frozen=True, slots=True)
class Signals:
    """The signals of one ``medium`` of a ``link``, whose ``model`` has a radio; ``ranged`` ends them, if it does.

    Partitions, and times at which a link is bad, do not weaken them.
    """

    link: Link
    medium: str
    model: LognormalPrr | Measured | Csma154
    ranged: Ranged | None = None

    @classmethod
    def of(cls, link: Link, medium: str) -> Signals | None:
        """Those of a medium; None if it has no radio."""
        inner: Link = link
        end: Ranged | None = None
        while not isinstance(inner, LognormalPrr | Measured | Csma154):
            if isinstance(inner, Media) and medium in inner.links:
                inner = inner.links[medium]
            elif isinstance(inner, Ranged):
                end, inner = inner, inner.link
            elif isinstance(inner, Bursty | Lossy | Partitioned):
                inner = inner.link
            else:
                return None
        return cls(link, medium, inner, end)

    @property
    def radio(self) -> Radio:
        """That of all processes."""
        return self.model.radio

    @property
    def reach_m(self) -> float:
        """Beyond this distance all signals are too weak; infinite if distance does not matter."""
        own = self.model.signal_m if isinstance(self.model, LognormalPrr) else inf
        return own if self.ranged is None else min(own, self.ranged.range_m)

    def on_air(self, frame: Transmission) -> tuple[OnAir, ...]:
        """The transmissions of a frame and its acknowledgements, in order, by the draws of its fate."""
        found = self.model.on_air(frame)
        if any(one.answer for one in found) and not self.link.fate(frame).ack_air_ns:
            return tuple(one for one in found if not one.answer)  # it does not get through
        return found

    def tries(self, frame: Transmission) -> int:
        """How often each fragment of a frame is sent at most."""
        return self.model.tries(frame)

    def db(self, src: str, dst: str, at_ns: int = 0) -> float | None:
        """How strong (dB above the noise) the signal of ``src`` is at ``dst``; None if it is too weak to disturb.

        0 in a model that knows no strengths, in which no signal is stronger than another; of measured links those
        disturb that deliver anything.
        """
        if self.ranged is not None and not self.ranged.reaches(src, dst, at_ns):
            return None
        if isinstance(self.model, Measured):
            return 0.0 if self.model.ratio(src, dst, at_ns) >= LEAST_SHARE else None
        if isinstance(self.model, Csma154):
            return 0.0
        try:
            snr_db = self.model.snr_db(src, dst, at_ns, self.medium)
        except KeyError:
            return None
        return snr_db if snr_db >= self.model.least_db else None
