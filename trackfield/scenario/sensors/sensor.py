"""What all kinds of sensors have in common."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Annotated, Any, ClassVar, Final, Literal

from pydantic import Field

from trackfield.plugins import Maker
from trackfield.scenario.quantities import MOST_NODES, SomeShare
from trackfield.scenario.section import FileName, Section, Word
from trackfield.sensing.complete import Kind
from trackfield.sensing.kinds import SENSORS, hashable, make_sensor

OF_GROUPS: Final = ("nodes", "share")
"""The keys that say which sensors are of a kind: those of ``[[sensors]]`` alone."""

SOUND_FILES: Final = (".wav", ".flac")
"""What the names of recordings end with that are of sound."""

Ids = Annotated[tuple[Word, ...], Field(min_length=1, max_length=MOST_NODES)]


class SensorSection(Section):
    """The sensors of a field, or some of them, all of a kind.

    ``reach_key`` is the key that says how far they reach, ``speed_key`` how fast what they sense travels.
    """

    reach_key: ClassVar[str] = "range_m"
    speed_key: ClassVar[str] = "speed_m_s"

    kind: str
    nodes: Ids | None = Field(default=None, description="which sensors are of this kind, by id; in [[sensors]] only")
    share: SomeShare | None = Field(
        default=None,
        description="share of all sensors, drawn by seed and number; instead of nodes, in [[sensors]] only",
    )
    recording: FileName | None = Field(
        default=None,
        description="CSV or Parquet file of what real sensors reported, which these play, or WAV or FLAC file of what "
        "they heard; relative to the scenario's own folder",
    )
    play: Literal["readings", "times"] = Field(
        default="readings",
        description="of a recording: what was reported, or only when; readings are then those of the emulated target",
    )
    position_error_m: float = Field(
        default=0.0,
        ge=0,
        le=10_000,
        description="standard deviation, east and north, of the error in the centre's knowledge of a sensor's place",
    )

    @property
    def options(self) -> Mapping[str, Any]:
        """The arguments of its class."""
        raise NotImplementedError

    @property
    def listens_to(self) -> str | None:
        """The recording, if it is of sound."""
        heard = self.recording is not None and self.recording.lower().endswith(SOUND_FILES)
        return self.recording if heard else None

    @property
    def plays(self) -> bool:
        """Whether these sensors play what real ones reported."""
        return self.recording is not None and self.listens_to is None

    @property
    def plain(self) -> dict[str, Any]:
        """The arguments of ``make_sensor``."""
        recorded = {"recorded": True} if self.plays else {}
        return {"kind": self.kind, "options": dict(self.options), **recorded}

    @property
    def sensing(self) -> Kind:
        """The kind of sensing with these options. Raises ``ScenarioError`` as ``make_sensor`` does."""
        options = hashable(self.options)
        return _made(SENSORS.get(self.kind), self.kind, options, recorded=self.plays)


@lru_cache(maxsize=64)
def _made(maker: Maker | None, kind: str, options: tuple[tuple[str, Any], ...], *, recorded: bool) -> Kind:
    """The same object for the same arguments; ``maker`` tells classes apart that were registered by one name."""
    return make_sensor(kind, dict(options), recorded=recorded)
