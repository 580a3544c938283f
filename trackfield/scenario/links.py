"""The link models of a scenario file: the radio from each sensor."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal, Self

from pydantic import BeforeValidator, Field, PlainSerializer, WithJsonSchema, model_validator

from trackfield.scenario.section import Delay, NotNegative, Positive, Section, Share, wrong

Busy = Annotated[float, Field(ge=0, le=0.99)]
Attempts = Annotated[int, Field(ge=0, le=100)]

_ACKS: Final = "a table of whole numbers from 0 to 100, like { doa = 4 }"


def _pairs(value: Any) -> Any:
    """A scenario is hashable, so a table is kept as its pairs."""
    if not isinstance(value, Mapping):
        raise wrong(f"is {value!r}", _ACKS)
    return tuple(sorted(value.items()))


Acks = Annotated[
    tuple[tuple[str, Attempts], ...],
    BeforeValidator(_pairs),
    PlainSerializer(dict),
    WithJsonSchema({"type": "object", "additionalProperties": {"type": "integer", "minimum": 0, "maximum": 100}}),
]


class _Link(Section):
    range_m: Positive | None = Field(default=None, description="who is further away hears nothing; unset: no limit")


class _Radio(_Link):
    busy: Busy = Field(default=0.0, description="share of the time in which the channel is found busy")
    acks: Acks | None = Field(
        default=None, json_schema_extra={"expected": _ACKS}, description="ack for single kinds of message, by name"
    )
    queue: int = Field(
        default=32, ge=1, le=10_000, description="how many frames wait for a radio that is sending; more are dropped"
    )


class Ideal(_Link):
    """Loses nothing, takes 1 ms."""

    model: Literal["ideal"] = Field(default="ideal", description="loses nothing, takes 1 ms")


class Fixed(_Link):
    """Independent losses, constant delay."""

    model: Literal["fixed"] = Field(default="fixed", description="independent losses, constant delay")
    loss: Share = Field(default=0.05, description="share of the frames lost")
    delay_ms: Delay = Field(default=5.0, description="from sending to arrival")


class GilbertElliott(_Link):
    """Bursts of losses, random delay."""

    model: Literal["gilbert_elliott"] = Field(default="gilbert_elliott", description="losses in bursts, random delay")
    good_s: Positive = Field(default=50.0, description="mean time that a link stays good")
    bad_s: Positive = Field(default=4.0, description="mean time that it stays bad")
    loss_good: Share = Field(default=0.0, description="share of the frames lost while it is good")
    loss_bad: Share = Field(default=1.0, description="share of the frames lost while it is bad")
    delay_ms: Delay = Field(default=20.0, description="shortest time from sending to arrival")
    jitter_ms: NotNegative = Field(default=10.0, description="mean of the exponentially distributed time on top")


class Ethernet(_Link):
    """A wire: loses nothing, takes the same time always."""

    model: Literal["ethernet"] = Field(default="ethernet", description="a wire: loses nothing, constant delay")
    delay_ms: Delay = Field(default=1.0, description="from sending to arrival")


class LognormalPrr(_Radio):
    """Path loss with frozen shadowing, a radio's reception curve, its access to the channel."""

    model: Literal["lognormal_prr"] = Field(
        default="lognormal_prr", description="a radio, its reach decided by distance and shadowing"
    )
    radio: Literal["802154-0dbm", "802154-20dbm", "lora868", "mica2", "wifi11b"] = Field(
        default="802154-20dbm", description="sets power, noise, frame size, speed and access to the channel"
    )
    channel: Literal["castalia", "usc", "petajajarvi"] | None = Field(
        default=None,
        description="path loss over distance; unset: petajajarvi for lora868, usc for mica2, else castalia",
    )
    tx_dbm: float | None = Field(default=None, ge=-60, le=40, description="transmission power; unset: the radio's")
    noise_dbm: float | None = Field(default=None, ge=-180, le=0, description="noise floor; unset: the radio's")
    sf: int | None = Field(default=None, ge=7, le=12, description="spreading factor, of lora868 alone; unset: 9")
    ack: Attempts | None = Field(
        default=None,
        description="how often a frame is sent until acknowledged; 0: once, without; unset: 7 for wifi11b, else 0",
    )

    @model_validator(mode="after")
    def _spreading_factor_of_lora(self) -> Self:
        if self.sf is not None and self.radio != "lora868":
            raise wrong(
                f"is {self.sf}, and {self.radio} has no spreading factor",
                "no spreading factor, or link.radio=lora868",
                "link.sf",
            )
        return self


class Csma154(_Radio):
    """The delays of 802.15.4 alone: who finds the channel busy five times gives up, all else arrives."""

    model: Literal["csma154"] = Field(default="csma154", description="the delays of an 802.15.4 radio in easy reach")
    ack: Attempts = Field(
        default=0, description="how often a frame is sent at most until it is acknowledged; 0: once, without"
    )


class Trace(_Link):
    """A measured link, replayed."""

    model: Literal["trace"] = Field(default="trace", description="a measured link, replayed")
    file: str = Field(
        min_length=1, description="CSV file (src,dst,t_s,received,delay_ms), relative to the scenario's own folder"
    )


Link = Ideal | Fixed | GilbertElliott | LognormalPrr | Csma154 | Ethernet | Trace
