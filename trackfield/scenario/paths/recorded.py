"""The path ``recording``."""

from __future__ import annotations

from math import ceil
from pathlib import Path as FilePath
from typing import Literal

from pydantic import Field

from trackfield.errors import ScenarioError
from trackfield.scenario.paths.path import NS, Course, PathSection
from trackfield.scenario.section import FileName
from trackfield.world.path import Path
from trackfield.world.recording import Start, read_recording


class Recorded(PathSection):
    """Where the target of recorded reports was, as far as the recording says so."""

    path: Literal["recording"] = Field(
        default="recording",
        description="as the first recording that sensors play says, if it does; the first step is half a step before "
        "its first report. A scenario with a recording has this path if it has no [target]",
    )

    recording: FileName | None = Field(
        default=None,
        description="a recording that no sensor plays, relative to the scenario's own folder; unset: those that "
        "sensors play",
    )

    def run(self, course: Course) -> tuple[int, Path | None]:
        """To the last report of all recordings or to the end of the sound that sensors listen to, whichever is later.

        There is no path if no recording says where the target was.
        """
        recordings = course.recordings if self.recording is None else (read_recording(FilePath(self.recording)),)
        heard = ceil(course.heard_s * NS / course.step_ns)
        if not recordings and heard:
            return heard, None
        if not recordings:
            what = "no sensors play a recording"
            expected = f"a recording in [sensor], {course.key}.recording, or another path"
            raise ScenarioError(what, key=f"{course.key}.path", expected=expected)
        start = Start.of(recordings, course.step_ns / NS)
        first_s = {one.file: one.first_step_s(start) for one in recordings}
        end_ns = max(round((one.t_s[-1] - first_s[one.file]) * NS) for one in recordings)
        path = next((one.truth.shifted(-first_s[one.file]) for one in recordings if one.truth), None)
        return max(-(-end_ns // course.step_ns), heard), path
