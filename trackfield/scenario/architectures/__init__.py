"""``[architecture]``: how processes are connected. Trackfield's own are a file here and a line in the table.

Any other kind is a user's own architecture.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

from trackfield.scenario.architectures.architecture import ArchitectureSection
from trackfield.scenario.architectures.centralised import CENTRALISED, Centralised
from trackfield.scenario.architectures.clusters import CLUSTERS, Clusters
from trackfield.scenario.architectures.cpa import CPA, Cpa
from trackfield.scenario.architectures.own import OwnArchitecture
from trackfield.scenario.architectures.peers import ELECTED, LOCATION_CENTRAL, Elected, LocationCentral
from trackfield.scenario.section import OTHER, open_union

__all__ = [
    "ARCHITECTURES",
    "Architecture",
    "ArchitectureSection",
    "Centralised",
    "Clusters",
    "Cpa",
    "Elected",
    "LocationCentral",
    "OwnArchitecture",
]

ARCHITECTURES: Final[Mapping[str, type[ArchitectureSection]]] = {
    CENTRALISED: Centralised,
    CLUSTERS: Clusters,
    LOCATION_CENTRAL: LocationCentral,
    ELECTED: Elected,
    CPA: Cpa,
    OTHER: OwnArchitecture,
}

if TYPE_CHECKING:
    Architecture = ArchitectureSection
else:
    Architecture = open_union(ARCHITECTURES, CENTRALISED)
