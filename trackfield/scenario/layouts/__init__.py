"""``[field]``: where the sensors stand. A layout is a file here and a line in the table."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from trackfield.scenario.layouts.along_path import AlongPath
from trackfield.scenario.layouts.beside import Beside
from trackfield.scenario.layouts.cells import CellsSection
from trackfield.scenario.layouts.grid import Grid
from trackfield.scenario.layouts.jittered import Jittered
from trackfield.scenario.layouts.layout import Ground, LayoutSection
from trackfield.scenario.layouts.pentagon import Pentagon
from trackfield.scenario.layouts.ring import Ring
from trackfield.scenario.layouts.scattered import Scattered
from trackfield.scenario.layouts.surveyed import Surveyed
from trackfield.scenario.section import one_of

__all__ = [
    "LAYOUTS",
    "AlongPath",
    "Beside",
    "CellsSection",
    "Grid",
    "Ground",
    "Jittered",
    "Layout",
    "LayoutSection",
    "Pentagon",
    "Ring",
    "Scattered",
    "Surveyed",
]

LAYOUTS: Final[tuple[type[LayoutSection], ...]] = (
    Grid,
    Jittered,
    Scattered,
    Ring,
    Pentagon,
    AlongPath,
    CellsSection,
    Beside,
    Surveyed,
)

if TYPE_CHECKING:
    Layout = LayoutSection
else:
    Layout = one_of(LAYOUTS, "layout")
