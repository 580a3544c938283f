"""``[link]``: the radio between nodes and centre. A link model is a file here and a line in the table."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from trackfield.scenario.links.csma154 import Csma154
from trackfield.scenario.links.ethernet import Ethernet
from trackfield.scenario.links.fixed import Fixed
from trackfield.scenario.links.gilbert_elliott import GilbertElliott
from trackfield.scenario.links.ideal import Ideal
from trackfield.scenario.links.link import LinkSection
from trackfield.scenario.links.lognormal_prr import LognormalPrr
from trackfield.scenario.links.serial import Serial
from trackfield.scenario.links.trace import Trace
from trackfield.scenario.section import one_of

__all__ = [
    "LINKS",
    "Csma154",
    "Ethernet",
    "Fixed",
    "GilbertElliott",
    "Ideal",
    "Link",
    "LinkSection",
    "LognormalPrr",
    "Serial",
    "Trace",
]

LINKS: Final[tuple[type[LinkSection], ...]] = (
    Ideal,
    Fixed,
    GilbertElliott,
    LognormalPrr,
    Csma154,
    Ethernet,
    Serial,
    Trace,
)

if TYPE_CHECKING:
    Link = LinkSection
else:
    Link = one_of(LINKS, "model")
