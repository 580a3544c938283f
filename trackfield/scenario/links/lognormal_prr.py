"""The link model ``lognormal_prr``."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, model_validator

from trackfield.scenario.links.link import Attempts, RadioSection
from trackfield.scenario.section import wrong


class LognormalPrr(RadioSection):
    """Path loss with frozen shadowing, a radio's reception curve, its access to the channel."""

    model: Literal["lognormal_prr"] = Field(
        default="lognormal_prr", description="a radio whose reception depends on distance and shadowing"
    )
    radio: Literal["802154-0dbm", "802154-20dbm", "lora868", "mica2", "wifi11b"] = Field(
        default="802154-20dbm", description="sets power, noise, frame size, speed and access to the channel"
    )
    channel: Literal["castalia", "usc", "petajajarvi"] | None = Field(
        default=None,
        description="path loss over distance; unset: petajajarvi for lora868, usc for mica2, else castalia",
    )
    pl0_db: float | None = Field(
        default=None, ge=0, le=300, description="path loss at 1 m; unset, as the next three: the channel's"
    )
    exponent: float | None = Field(
        default=None, ge=0, le=20, description="by 10 times as much the path loss grows with ten times the distance"
    )
    sigma_db: float | None = Field(default=None, ge=0, le=50, description="sd of the shadowing of a pair of processes")
    asymmetry_db: float | None = Field(
        default=None, ge=0, le=50, description="sd by which each direction of a pair differs from that"
    )
    tx_dbm: float | None = Field(default=None, ge=-60, le=40, description="transmission power; unset: the radio's")
    noise_dbm: float | None = Field(default=None, ge=-180, le=0, description="noise floor; unset: the radio's")
    sf: int | None = Field(default=None, ge=7, le=12, description="spreading factor, for lora868 only; unset: 9")
    ack: Attempts | None = Field(
        default=None,
        description="most transmissions until acknowledged; 0: sent once, no ack; unset: 7 for wifi11b, else 0",
    )

    @model_validator(mode="after")
    def _spreading_factor_of_lora(self) -> Self:
        if self.sf is not None and self.radio != "lora868":
            raise wrong(
                f"is {self.sf}, and {self.radio} has no spreading factor",
                'no spreading factor, or radio = "lora868"',
                ".sf",
            )
        return self
