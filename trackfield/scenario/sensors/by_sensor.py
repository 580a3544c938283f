"""Options of a kind of sensing that are tables: a number for each of some sensors, by id."""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Iterator, Mapping
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, Final

from pydantic import BeforeValidator, PlainSerializer, WithJsonSchema

from trackfield.errors import ScenarioError, together
from trackfield.scenario.nearest import suggestion
from trackfield.scenario.quantities import MOST_NODES
from trackfield.scenario.section import ID, ID_WORDS, wrong
from trackfield.words import quoted, shortened

if TYPE_CHECKING:
    from trackfield.scenario.sensors.sensor import SensorSection

Numbers = tuple[tuple[str, float], ...]
"""(id, number), in order: a scenario is hashable, so tables are kept as their pairs."""
_ID: Final = re.compile(ID)


def by_sensor(least: float, most: float, example: str) -> Any:
    """The type of a table by sensor whose numbers are within these, both included."""
    words = f"a table by sensor, like {{ {example} }}, of numbers from {least:g} to {most:g}"
    numbers = {"type": "number", "minimum": least, "maximum": most}
    return Annotated[
        Numbers,
        BeforeValidator(partial(_pairs, least, most, words)),
        PlainSerializer(dict),
        WithJsonSchema({"type": "object", "additionalProperties": numbers, "expected": words}),
    ]


def _pairs(least: float, most: float, words: str, value: Any) -> Numbers:
    if not isinstance(value, Mapping) or len(value) > MOST_NODES:
        raise wrong(f"is {shortened(json.dumps(value, default=quoted))}", words)
    return tuple(sorted((_id(id), _number(least, most, id, one)) for id, one in value.items()))


def _id(id: object) -> str:
    if not isinstance(id, str) or not _ID.fullmatch(id):
        raise wrong(f"has the key {quoted(id)}", f"ids of sensors: {ID_WORDS}")
    return id


def _number(least: float, most: float, id: str, value: Any) -> float:
    if type(value) not in (int, float) or not least <= value <= most:
        raise wrong(f"is {quoted(value)}", f"a number from {least:g} to {most:g}", f".{id}")
    return float(value)


if TYPE_CHECKING:
    Decibels = Numbers
    Factors = Numbers
    Anything = Numbers
else:
    Decibels = by_sensor(-100, 100, "n001 = 1.5")
    Factors = by_sensor(1e-6, 1e6, "n001 = 1.5")
    Anything = by_sensor(-1e15, 1e15, "n001 = 1.5")


def check_tables(sections: Collection[tuple[str, SensorSection]], ids: Collection[str]) -> None:
    """Raise ``ScenarioError`` if a table of these sections is about a sensor that is none of the field's ``ids``."""
    known = set(ids)
    together(partial(_unknown, key, id, ids) for key, id in _named(sections) if id not in known)


def _named(sections: Collection[tuple[str, SensorSection]]) -> Iterator[tuple[str, str]]:
    """The key of each table, with each sensor that it is about."""
    for key, section in sections:
        for name, value in section.options.items():
            for id in value if isinstance(value, Mapping) else ():
                yield f"{key}.{name}", id


def _unknown(key: str, id: str, ids: Collection[str]) -> None:
    what = f"{quoted(id)} is no sensor of the field{suggestion(id, ids)}"
    raise ScenarioError(what, key=key, expected=f"ids of the field, like {next(iter(ids))}")
