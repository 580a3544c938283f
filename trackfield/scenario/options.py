"""Options of single trackers: ``fusion.options``, a table of tables."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Annotated, Any, Final

from pydantic import BeforeValidator, PlainSerializer, TypeAdapter, ValidationError, WithJsonSchema

from trackfield.scenario.quantities import Option
from trackfield.scenario.section import wrong
from trackfield.words import quoted, shortened

EXPECTED: Final = "a table by tracker, like { spcpf = { nominals = 10 } }"
_VALUE: Final = TypeAdapter[Option](Option)


def _pairs(value: Any) -> Any:
    """A scenario is hashable, so tables are kept as their pairs."""
    if not isinstance(value, Mapping) or not all(isinstance(some, Mapping) for some in value.values()):
        raise wrong(f"is {quoted(value)}", EXPECTED)
    for name, some in value.items():
        for option, one in some.items():
            try:
                _VALUE.validate_python(one)
            except ValidationError:
                expected = "true or false, a text of at most 1000 characters, or a number from -1e15 to 1e15"
                shown = shortened(json.dumps(one, default=quoted))
                raise wrong(f"is {shown}", expected, f".{name}.{option}") from None
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
