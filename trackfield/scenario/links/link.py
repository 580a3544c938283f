"""What all link models have in common, and what all radios have."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Final, Self

from pydantic import BeforeValidator, Field, PlainSerializer, WithJsonSchema, model_validator

from trackfield.link.models import BURST_S
from trackfield.scenario.quantities import Distance, Duration, Exact
from trackfield.scenario.section import Section, Word, wrong
from trackfield.words import quoted

Busy = Annotated[float, Field(ge=0, le=0.99), Exact]
Attempts = Annotated[int, Field(ge=0, le=100)]

_ACKS: Final = "a table of whole numbers from 0 to 100, like { doa = 4 }"


def _pairs(value: Any) -> Any:
    """A scenario is hashable, so a table is kept as its pairs."""
    if not isinstance(value, Mapping):
        raise wrong(f"is {quoted(value)}", _ACKS)
    return tuple(sorted(value.items()))


Acks = Annotated[
    tuple[tuple[Word, Attempts], ...],
    Field(max_length=100),
    BeforeValidator(_pairs),
    PlainSerializer(dict),
    WithJsonSchema({"type": "object", "additionalProperties": {"type": "integer", "minimum": 0, "maximum": 100}}),
]


BurstLoss = Annotated[float, Field(gt=0, le=0.99), Exact]
ExtraLoss = Annotated[float, Field(ge=0, le=0.99), Exact]


class LinkSection(Section):
    """A link; ``model`` is its name."""

    model: str
    range_m: Distance | None = Field(
        default=None, description="beyond this distance nothing is received; unset: no limit"
    )
    burst_loss: BurstLoss | None = Field(
        default=None,
        description="share of the time in which a link is bad and delivers nothing, on top of the model; unset: none",
    )
    burst_s: Duration | None = Field(
        default=None, description=f"mean time that it is bad; unset: {BURST_S:g}, if burst_loss is set"
    )
    extra_loss: ExtraLoss | None = Field(
        default=None,
        description="share of transmissions, repeats and acknowledgements too, lost on top of the model; unset: none",
    )

    @model_validator(mode="after")
    def _bursts(self) -> Self:
        if self.burst_s is not None and self.burst_loss is None:
            raise wrong(f"is {self.burst_s:g}, and burst_loss is unset", "burst_loss as well", ".burst_s")
        return self


class RadioSection(LinkSection):
    """A link by radio."""

    busy: Busy = Field(default=0.0, description="share of the time in which the channel is found busy")
    acks: Acks | None = Field(
        default=None,
        json_schema_extra={"expected": _ACKS},
        description="ack of single kinds of message, by the kind's name",
    )
    queue: int = Field(
        default=32,
        ge=1,
        le=10_000,
        description="most frames that wait while the radio is sending; further ones are dropped",
    )
