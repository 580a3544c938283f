"""Options of single trackers: ``fusion.options``, a table of tables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Final

from pydantic import BeforeValidator, PlainSerializer, WithJsonSchema

from trackfield.scenario.quantities import Option
from trackfield.scenario.section import wrong
from trackfield.words import quoted

EXPECTED: Final = "a table by tracker, like { spcpf = { nominals = 10 } }"


def _pairs(value: Any) -> Any:
    """A scenario is hashable, so tables are kept as their pairs."""
    if not isinstance(value, Mapping) or not all(isinstance(some, Mapping) for some in value.values()):
        raise wrong(f"is {quoted(value)}", EXPECTED)
    return tuple((name, tuple(sorted(some.items()))) for name, some in sorted(value.items()))


def tables(options: tuple[tuple[str, tuple[tuple[str, Option], ...]], ...]) -> dict[str, dict[str, Option]]:
    """The options by tracker and name, as they are written."""
    return {name: dict(some) for name, some in options}


Options = Annotated[
    tuple[tuple[str, tuple[tuple[str, Option], ...]], ...],
    BeforeValidator(_pairs),
    PlainSerializer(tables),
    WithJsonSchema({"type": "object", "additionalProperties": {"type": "object"}}),
]
