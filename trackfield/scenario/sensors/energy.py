"""The sensor ``energy``."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from trackfield.scenario.quantities import Exact, Share
from trackfield.scenario.section import wrong
from trackfield.scenario.sensors.built_in import BuiltInSensor, Decay, Near, Reach, Variation
from trackfield.scenario.sensors.by_sensor import Factors

SLOWEST_M_S = 1.0
"""Anything slower is no sound; 0 says that it arrives at once."""


class EnergySensor(BuiltInSensor):
    """A microphone that measures the energy of sound, the same at every node."""

    speed_key: ClassVar[str] = "sound_m_s"

    kind: Literal["energy"] = Field(default="energy", description="a microphone that measures the energy of sound")
    range_m: Reach = Field(default=150.0, description="beyond this distance from every target nothing is measured")
    emitted: float = Field(default=1e5, ge=1e-6, le=1e9, description="a target's energy at 1 m, for a gain of 1")
    alpha: Decay = Field(default=2.0929, description="decay: the energy falls with this power of the distance")
    gain: float = Field(default=1.0, ge=1e-6, le=1e6, description="factor of what a sensor measures")
    floor_m: Near = Field(default=2.0, description="nearer than this the energy is as at this distance")
    noise: float = Field(default=0.9298, ge=1e-6, le=1e9, description="standard deviation of the surroundings' noise")
    relative: Variation = Field(
        default=0.2, description="standard deviation of the calibration, as a share of what is measured"
    )
    emitted_sd: float = Field(
        default=0.1, ge=1e-6, le=10, description="standard deviation of what trackers know of log(emitted) at the start"
    )
    emitted_walk: Variation = Field(
        default=0.01, description="standard deviation by which log(emitted) changes in a second, as trackers assume"
    )
    window_s: Annotated[float, Field(ge=0, le=60), Exact] = Field(
        default=0.0, description="a reading is the mean over this time before its step; 0: what arrives at its instant"
    )
    sound_m_s: Annotated[float, Field(ge=0, le=100_000), Exact] = Field(
        default=0.0, description="speed of sound, such as 343; 0: it arrives at once"
    )
    compensate_window: bool = Field(default=True, description="trackers take a reading as of the middle of its window")
    compensate_delay: bool = Field(default=True, description="trackers allow for the time that the sound takes")
    missing: Share = Field(default=0.0, description="share of all readings that are not there, wherever the target is")
    gains: Factors = Field(
        default=(),
        description="factors by which single sensors read more than others, noise included; trackers know them, and "
        "take them off",
    )

    @model_validator(mode="after")
    def _sound_arrives(self) -> Self:
        if 0.0 < self.sound_m_s < SLOWEST_M_S:
            raise wrong(f"is {self.sound_m_s:g}", f"0, or a speed from {SLOWEST_M_S:g} m/s on", ".sound_m_s")
        return self
