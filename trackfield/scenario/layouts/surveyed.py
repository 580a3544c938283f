"""The layout ``file``."""

from __future__ import annotations

from pathlib import Path as FilePath
from typing import Literal

from pydantic import Field

from trackfield.scenario.layouts.layout import Ground, LayoutSection
from trackfield.scenario.places import Place, Point, read_places
from trackfield.scenario.section import FileName


class Surveyed(LayoutSection):
    """Sensors at the places that a file gives."""

    layout: Literal["file"] = Field(default="file", description="at the places that a file gives")
    file: FileName = Field(
        description="CSV file with id and lat,lon or x,y of each sensor, relative to the scenario's own folder",
    )

    def stand(self, ground: Ground) -> tuple[list[Place], Point | None]:
        """See ``LayoutSection``; the file may also give the fusion centre's place."""
        return read_places(FilePath(self.file), ground.origin(), ground.centre)
