"""The path ``file``."""

from __future__ import annotations

from datetime import date, datetime, time
from pathlib import Path as FilePath
from typing import Annotated, Any, Final, Literal

from pydantic import BeforeValidator, Field, JsonValue

from trackfield.errors import ScenarioError
from trackfield.scenario.paths.path import Course, PathSection, whole_steps
from trackfield.scenario.section import FileName, Word
from trackfield.world.path import Path
from trackfield.world.recording import Start
from trackfield.world.tracks import read_track, track_origin, track_start
from trackfield.world.windows import Array


def _text(value: Any) -> Any:
    """TOML has its own type for times, and a track may count seconds: both become text."""
    if isinstance(value, time | date | datetime):
        return value.isoformat()
    return str(value) if isinstance(value, int | float) and not isinstance(value, bool) else value


_MOMENT: Final[dict[str, JsonValue]] = {
    "expected": "HH:MM[:SS], an ISO date and time, or seconds for a file that counts seconds"
}
Moment = Annotated[Word, BeforeValidator(_text)]


class FromFile(PathSection):
    """A recorded track."""

    path: Literal["file"] = Field(default="file", description="a recorded track")
    file: FileName = Field(description="GPX or CSV file, relative to the scenario's own folder")
    from_: Moment | None = Field(
        default=None,
        alias="from",
        json_schema_extra=_MOMENT,
        description="time of the first step; unset: the file's first fix",
    )
    to: Moment | None = Field(
        default=None, json_schema_extra=_MOMENT, description="time of the end; unset: the file's last fix"
    )
    hasten: float = Field(
        default=1.0, ge=0.1, le=10, description="the target goes along the track so many times as fast as recorded"
    )

    def run(self, course: Course) -> tuple[int, Path]:
        """See ``PathSection``. Recorded reports belong to the track as it was recorded."""
        if self.hasten != 1 and course.recordings:
            what = f"is {self.hasten:g}, and sensors play what was recorded at the track's own speed"
            raise ScenarioError(what, key=f"{course.key}.hasten", expected="1, or sensors without a recording")
        path = read_track(FilePath(self.file), self.from_, self.to, origin=course.origin, key=course.key)
        return whole_steps(path.hastened(self.hasten), course)

    def start(self, key: str) -> Start:
        """See ``PathSection``."""
        return Start(*track_start(FilePath(self.file), self.from_, self.to, key=key))

    def origin(self, key: str) -> Array | None:
        """See ``PathSection``."""
        return track_origin(FilePath(self.file), self.from_, self.to, key=key)
