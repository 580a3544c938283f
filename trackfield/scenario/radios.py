"""What the radios of single roles or processes have of their own: ``[radio.<role>]``, a table of tables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal, get_args

from pydantic import BeforeValidator, Field, PlainSerializer, ValidationError, WithJsonSchema

from trackfield.scenario.section import Section, wrong
from trackfield.words import quoted

EXPECTED: Final = "a table by role or id, like { node = { tx_dbm = 10 } }"
MOST: Final = 1000

Device = Literal["cc2420", "cc2420-20dbm", "sx1276", "wifi11b"]
DEVICES: Final = get_args(Device)
"""Devices whose power figures are known (``trackfield.link.energy.DEVICES``)."""
Power = Annotated[float, Field(ge=-60, le=40)]
"""A transmit power (dBm)."""


class OwnRadio(Section):
    """What a radio of the field has of its own; what is unset is as for all others."""

    tx_dbm: Power | None = Field(default=None, description="transmission power; unset: that of the link")
    device: Device | None = Field(default=None, description="device whose power figures are used; unset: as the others")


_WORDS: Final = {"tx_dbm": "a number from -60 to 40", "device": f"one of {', '.join(DEVICES)}"}


def _pairs(value: Any) -> Any:
    """A scenario is hashable, so tables are kept as their pairs."""
    tables = isinstance(value, Mapping) and all(isinstance(one, Mapping) for one in value.values())
    if not tables or len(value) > MOST:
        raise wrong(f"is {quoted(value)}", EXPECTED)
    return tuple((name, _own(name, one)) for name, one in sorted(value.items()))


def _own(name: str, given: Mapping[str, Any]) -> tuple[tuple[str, float | str], ...]:
    for key in given:
        if key not in _WORDS:
            raise wrong("unknown", f"one of {', '.join(_WORDS)}", f".{name}.{key}")
    try:
        return tuple(sorted(OwnRadio.model_validate(given).model_dump(exclude_none=True).items()))
    except ValidationError as error:
        key = str(error.errors()[0]["loc"][0])
        raise wrong(f"is {quoted(given[key])}", _WORDS[key], f".{name}.{key}") from None


def _tables(radios: tuple[tuple[str, tuple[tuple[str, float | str], ...]], ...]) -> dict[str, dict[str, float | str]]:
    return {name: dict(own) for name, own in radios}


Radios = Annotated[
    tuple[tuple[str, tuple[tuple[str, float | str], ...]], ...],
    BeforeValidator(_pairs),
    PlainSerializer(_tables),
    WithJsonSchema({"type": "object", "additionalProperties": {"type": "object"}}),
]
"""By role or id."""


def own_radios(radios: Radios) -> dict[str, OwnRadio]:
    """By role or id, as they are written."""
    return {name: OwnRadio.model_validate(own) for name, own in _tables(radios).items()}
