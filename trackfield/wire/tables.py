"""The tables of docs/wire.md, as Markdown: made from the registry and from the golden vectors."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final

from trackfield.wire.registry import Bytes, Field, product_kinds

MOST_DIGITS: Final = 240
"""Of more hexadecimal digits than this the tables show ..."""
ENDS: Final = 40
"""... so many at either end."""


def kinds_table() -> str:
    """All kinds with their fields, in the order in which they travel."""
    head = ["kind", "name", "position", "field", "range", "resolution", "unit", "integer on the wire"]
    rows = [
        [kind.number, kind.name, f"{position} .." if field.many else position, *_cells(field)]
        for kind in product_kinds()
        for position, field in enumerate(kind.fields, start=2)
    ]
    return _table(head, rows)


def vectors_tables(vectors: Mapping[str, Any]) -> str:
    """The golden vectors: messages, other accepted spellings, refused payloads, envelopes, and what has a seal."""
    messages = [[_plain(v["kind"], v["fields"]), f"`{_short(v['hex'])}`"] for v in vectors["messages"]]
    spellings = [[v["what"], f"`{v['hex']}`", f"`{v['canonical']}`"] for v in vectors["spellings"]]
    refused = [[v["what"], f"`{v['hex']}`", v["reason"]] for v in vectors["refused"]]
    envelopes = [[_plain("", v["fields"]), f"`{v['hex']}`"] for v in vectors["envelopes"]]
    sealed = [
        [v["what"], *(f"`{_short(v[part])}`" if v[part] else "empty" for part in ("key", "payload", "seal"))]
        for v in vectors["sealed"]
    ]
    return "\n\n".join(
        [
            _table(["message", "payload"], messages),
            _table(["accepted all the same", "payload", "means"], spellings),
            _table(["refused", "payload", "reason"], refused),
            _table(["envelope", "attachment"], envelopes),
            _table(["with a seal", "key", "payload", "attachment"], sealed),
        ]
    )


def _cells(field: Field) -> list[object]:
    if isinstance(field, Bytes):
        return [field.name, f"0 .. {field.blob.most} bytes", "", field.blob.unit, "the bytes"]
    scaled = field.scaled
    wraps = f", then {field.first} again" if scaled.cyclic else ""
    integers = f"{field.first} .. {field.last}{wraps}"
    return [field.name, f"{scaled.low} .. {scaled.high}", scaled.resolution, scaled.unit, integers]


def _plain(name: str, fields: Mapping[str, object]) -> str:
    return " ".join([name, *(f"{key}={_number(value)}" for key, value in fields.items())]).strip()


def _number(value: object) -> object:
    if isinstance(value, str):
        return _short(value)
    return ",".join(map(str, value)) if isinstance(value, list) else value


def _short(digits: str) -> str:
    """Hexadecimal digits, of very many only the ends."""
    if len(digits) <= MOST_DIGITS:
        return digits
    return f"{digits[:ENDS]}...{digits[-ENDS:]} ({len(digits) // 2} bytes)"


def _table(head: list[str], rows: Iterable[list[Any]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(map(str, line))} |" for line in lines)
