"""The sensor ``cpa``."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from trackfield.scenario.quantities import Exact, Length, Share
from trackfield.scenario.section import wrong
from trackfield.scenario.sensors.built_in import BuiltInSensor, Near, Reach
from trackfield.scenario.sensors.energy import SLOWEST_M_S

Power = Annotated[float, Field(ge=0, le=10), Exact]
"""The power of a distance or a speed with which noise changes."""
Decibels = Annotated[float, Field(ge=-100, le=200), Exact]
"""A level that a report can hold."""


class CpaSensor(BuiltInSensor):
    """A microphone that notices when a target passes, the same at every node."""

    speed_key: ClassVar[str] = "sound_m_s"

    kind: Literal["cpa"] = Field(
        default="cpa", description="a microphone that reports when a target passed, and how loud it was"
    )
    range_m: Reach = Field(default=50.0, description="beyond this distance no pass is noticed")
    sound_m_s: Annotated[float, Field(ge=0, le=100_000), Exact] = Field(
        default=340.0, description="speed of sound; 0: it arrives at once"
    )
    source_db: Decibels = Field(default=0.0, description="amplitude at 1 m from the target, in dB")
    source_sd_db: Annotated[float, Field(ge=0, le=100), Exact] = Field(
        default=0.0, description="standard deviation of what trackers know of source_db; 0: they know it"
    )
    time_sd_s: float = Field(
        default=0.1, ge=1e-6, le=10, description="standard deviation of the time of a pass at time_at_m and 13.4 m/s"
    )
    time_floor_m: Near = Field(default=3.0, description="nearer than this the time is as precise as at this distance")
    time_at_m: Reach = Field(default=12.0, description="distance for which time_sd_s is given")
    distance_power: Power = Field(
        default=0.0, description="the standard deviation of the time grows with this power of the distance"
    )
    speed_power: Power = Field(default=0.0, description="and falls with this power of the target's speed")
    strength_sd: Annotated[float, Field(ge=1e-6, le=10)] = Field(
        default=0.1, description="standard deviation of the amplitude, as a share of it"
    )
    use_strength: bool = Field(default=True, description="trackers use how loud a target was, and not only when")
    loss: Share = Field(default=0.0, description="share of all passes that are not noticed")
    variances: bool = Field(default=False, description="reports say how precise they are, too, which takes more bytes")
    waveform: bool = Field(
        default=False,
        description="passes are found in sound, sample by sample; what noise there is said to be, trackers assume",
    )
    detector: Literal["fit", "smooth", "argmax"] = Field(
        default="fit", description="with waveform, how a pass is found: as docs/listening.md says"
    )
    snr_db: Annotated[float, Field(ge=-100, le=200), Exact] = Field(
        default=10.0,
        description="with waveform, how much louder a target is at snr_at_m than the noise of the place above 100 Hz",
    )
    snr_at_m: Near = Field(default=20.0, description="with waveform, distance for which snr_db is given")
    place_sd_m: Length = Field(
        default=0.0, description="standard deviation of sensors' places, each way, that trackers allow for"
    )

    @model_validator(mode="after")
    def _sound_arrives(self) -> Self:
        if 0.0 < self.sound_m_s < SLOWEST_M_S:
            raise wrong(f"is {self.sound_m_s:g}", f"0, or a speed from {SLOWEST_M_S:g} m/s on", ".sound_m_s")
        if self.waveform and not self.sound_m_s:
            raise wrong("is 0, and sound is synthesised", "a speed, such as 340", ".sound_m_s")
        return self
