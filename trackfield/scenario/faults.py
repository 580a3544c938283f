"""The planned faults of a scenario file, one ``[[faults]]`` section each: what befalls whom, and when."""

from __future__ import annotations

from typing import Annotated, Final, Literal, Self, TypeVar

from pydantic import Field, model_validator

from trackfield.scenario.section import NotNegative, Positive, Section, wrong

MIN_DOWN_S: Final = 1.0
"""A process that is restarted is down for that long at least."""
SHORTEST_S: Final = 0.001
"""No fault lasts shorter, and no process ends earlier."""

T = TypeVar("T")
Ids = Annotated[tuple[str, ...], Field(min_length=1)]
Instant = Annotated[float, Field(ge=SHORTEST_S)]
Off = Annotated[float, Field(ge=-100, le=100)]


class _Fault(Section):
    nodes: Ids | None = Field(default=None, description="whom it befalls, by id; or say a share")
    share: float | None = Field(
        default=None, gt=0, le=1, description="of the sensor nodes, drawn by seed and the fault's number; or name nodes"
    )

    @model_validator(mode="after")
    def _befalls_someone(self) -> Self:
        if self.nodes is None and self.share is None:
            raise wrong("befalls nobody", "nodes, a list of ids, or share, from 0 to 1", ".nodes")
        if self.nodes is not None and self.share is not None:
            raise wrong("stands beside nodes", "either of them alone", ".share")
        for id in self.nodes or ():
            if self.nodes and self.nodes.count(id) > 1:
                raise wrong(f"{id!r} is there twice", "each id once", ".nodes")
        return self


class _Window(_Fault):
    at_s: NotNegative = Field(description="when it begins")
    until_s: Positive = Field(description="when it ends")

    @model_validator(mode="after")
    def _ends_after_it_begins(self) -> Self:
        return _ordered(self, self.at_s, self.until_s)


class _Sensor(_Fault):
    at_s: NotNegative = Field(description="when it begins")
    until_s: Positive | None = Field(default=None, description="when it ends; unset: never")

    @model_validator(mode="after")
    def _ends_after_it_begins(self) -> Self:
        return _ordered(self, self.at_s, self.until_s)


class Kill(_Fault):
    """A process ends, for good."""

    kind: Literal["kill"] = Field(default="kill", description="a process ends, for good")
    at_s: Instant = Field(description="when it happens")


class Freeze(_Window):
    """A process does nothing for a while."""

    kind: Literal["freeze"] = Field(default="freeze", description="a process does nothing for a while, and goes on")


class Partition(_Window):
    """Some cannot be reached by all others."""

    kind: Literal["partition"] = Field(
        default="partition", description="no frame passes between these and all others; each side has its own"
    )


class Restart(_Fault):
    """A process ends, and comes back knowing nothing."""

    kind: Literal["restart"] = Field(default="restart", description="a process ends, and begins anew later")
    at_s: Instant = Field(description="when it happens")
    until_s: Positive = Field(
        json_schema_extra={"expected": "a number, at least 1 s after at_s"}, description="when it is up again"
    )

    @model_validator(mode="after")
    def _is_down_for_a_while(self) -> Self:
        return _ordered(self, self.at_s, self.until_s, MIN_DOWN_S)


class Stuck(_Sensor):
    """A sensor reads the same over and over."""

    kind: Literal["stuck"] = Field(default="stuck", description="a sensor reads the same over and over")


class Bias(_Sensor):
    """A sensor's readings are off by a constant."""

    kind: Literal["bias"] = Field(default="bias", description="a sensor's readings are off by a constant")
    bias_deg: float = Field(default=0.0, ge=-180, le=180, description="added to the direction of arrival")
    bias_db: Off = Field(default=0.0, description="added to the level")

    @model_validator(mode="after")
    def _is_off(self) -> Self:
        if not self.bias_deg and not self.bias_db:
            raise wrong("is 0, and so is bias_db", "one of them at least to be another", ".bias_deg")
        return self


class Deaf(_Sensor):
    """A sensor hears nothing."""

    kind: Literal["deaf"] = Field(default="deaf", description="a sensor hears nothing")


class Babble(_Sensor):
    """A sensor reads nonsense, all the time."""

    kind: Literal["babble"] = Field(default="babble", description="a sensor reads loud nonsense in every step")


class ClockJump(_Fault):
    """A clock is wrong at once."""

    kind: Literal["clock_jump"] = Field(default="clock_jump", description="a process's clock jumps")
    at_s: NotNegative = Field(description="when it happens")
    jump_ms: float = Field(
        ge=-1e9,
        le=1e9,
        json_schema_extra={"expected": "a number from -1e9 to 1e9, but not 0"},
        description="by how much, forward or (below 0) back",
    )

    @model_validator(mode="after")
    def _jumps(self) -> Self:
        if not self.jump_ms:
            raise wrong("is 0", "a number from -1e9 to 1e9, but not 0", ".jump_ms")
        return self


Fault = Kill | Freeze | Partition | Restart | Stuck | Bias | Deaf | Babble | ClockJump
SensorFault = Stuck | Bias | Deaf | Babble


def _ordered(fault: T, at_s: float, until_s: float | None, least_s: float = SHORTEST_S) -> T:
    """The fault, unless it ends too early: an error."""
    if until_s is not None and round(until_s - at_s, 9) < least_s:  # 2.82 is a second after 1.82, but not in binary
        raise wrong(f"is {until_s:g}", f"a time at least {least_s:g} s after at_s, which is {at_s:g}", ".until_s")
    return fault
