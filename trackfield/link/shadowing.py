"""Path loss with log-normal shadowing, constant for each link.

PL(d) = PL0 + 10 n log10(d / d0) + N(0, sigma) [+ N(0, asymmetry)], in dB: the first draw belongs to the pair, the
second to the direction. Zuniga and Krishnamachari (2004), "Analyzing the Transitional Region in Low Power Wireless
Links", eq. 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, log10
from typing import Final

from trackfield.draw import normal
from trackfield.link.fate import FIELD, of_medium
from trackfield.link.places import Places, distance_m


@dataclass(frozen=True, slots=True)
class Channel:
    """Path loss: ``pl0_db`` at ``d0_m``, ``exponent`` n, ``sigma_db`` and ``asymmetry_db`` of its draws.

    Nearer than ``d0_m`` the loss is that at ``d0_m``; the far field, for which the law holds, begins there.
    """

    pl0_db: float
    exponent: float
    sigma_db: float
    asymmetry_db: float = 0.0
    d0_m: float = 1.0

    @property
    def sd_db(self) -> float:
        """The standard deviation of a directed link's loss at a known distance."""
        return hypot(self.sigma_db, self.asymmetry_db)

    def mean_db(self, distance_m: float) -> float:
        """The path loss in dB without shadowing."""
        return self.pl0_db + 10 * self.exponent * log10(max(distance_m / self.d0_m, 1.0))

    def loss_db(self, seed: int, places: Places, src: str, dst: str, at_ns: int = 0, medium: str = FIELD) -> float:
        """The path loss in dB from ``src`` to ``dst`` at an instant. Raises ``KeyError`` if a place is not known.

        Shadowing belongs to the link and the medium, not to the place: it stays the same for one that moves.
        """
        apart = of_medium(medium)
        pair = normal(seed, "shadow", *sorted((src, dst)), *apart) * self.sigma_db
        direction = normal(seed, "asymmetry", src, dst, *apart) * self.asymmetry_db
        return self.mean_db(distance_m(places, src, dst, at_ns)) + pair + direction


CHANNELS: Final = {
    # Castalia's defaults for a wireless sensor network at 2.4 GHz
    "castalia": Channel(55.0, 2.4, 4.0, asymmetry_db=1.0),
    # the outdoor measurements at USC in Zuniga and Krishnamachari (2004)
    "usc": Channel(55.0, 4.7, 3.2),
    # 868 MHz on land, Oulu: Petajajarvi et al. (2015), "On the coverage of LPWANs"; given for d0 = 1 km
    "petajajarvi": Channel(128.95 - 10 * 2.32 * 3, 2.32, 7.8),
}
