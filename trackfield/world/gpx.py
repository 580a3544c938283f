"""Track points of a GPX file, with the lines on which they stand."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final
from xml.parsers import expat

_POINT: Final = ["trk", "trkseg", "trkpt"]
"""The elements around a point of a track; a GPX file may hold routes and waypoints too."""
_TIME: Final = [*_POINT, "time"]
_LONGEST: Final = 1000
"""Characters of a time; more are no time."""


@dataclass
class TrackPoint:
    """A point as it is written: the line of its element, and the texts of its parts, None for one that is missing."""

    line: int
    lat: str | None
    lon: str | None
    time: str | None = None


@dataclass
class _Reader:
    """Collects points while a file is parsed; ``open`` are the names of the elements that are not closed yet."""

    parser: expat.XMLParserType
    points: list[TrackPoint] = field(default_factory=list)
    open: list[str] = field(default_factory=list)

    def begin(self, name: str, attributes: dict[str, str]) -> None:
        self.open.append(name.rpartition(":")[2])
        if self._in(_POINT):
            place = attributes.get("lat"), attributes.get("lon")
            self.points.append(TrackPoint(self.parser.CurrentLineNumber, *place))
        elif self._in(_TIME):
            self.points[-1].time = ""

    def text(self, text: str) -> None:
        if self._in(_TIME):
            self.points[-1].time = f"{self.points[-1].time}{text}"[:_LONGEST]

    def end(self, name: str) -> None:
        self.open.pop()

    def refuse(self, *about: object) -> None:
        raise ValueError(f"line {self.parser.CurrentLineNumber}: a document type, which GPX files do not have")

    def _in(self, path: list[str]) -> bool:
        """Whether these are the open elements below the first."""
        return len(self.open) == len(path) + 1 and self.open[1:] == path


def track_points(text: str) -> list[TrackPoint]:
    """The points of all segments of all tracks, in the file's order.

    Raises ``ValueError`` for a text that is no GPX, with the line. Document types are refused, and so entities that
    grow without end.
    """
    parser = expat.ParserCreate()
    reader = _Reader(parser)
    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler = reader.begin, reader.end
    parser.CharacterDataHandler = reader.text
    parser.StartDoctypeDeclHandler = reader.refuse
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        raise ValueError(f"line {error.lineno}: {expat.ErrorString(error.code)}") from None
    return reader.points
