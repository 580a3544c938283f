"""The tables of keys in docs/scenarios.md: ``python -m trackfield.scenario.document docs/scenarios.md``."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Final

from trackfield.scenario.keys import Key, sections_of_file, top_level

BEGIN: Final = "<!-- keys: begin (made by python -m trackfield.scenario.document) -->"
END: Final = "<!-- keys: end -->"


def tables() -> str:
    """Every key with unit, default, range and meaning, as Markdown; a table for each section."""
    parts = ["### Outside any section", "", *_table({"": top_level()}, "")]
    seen: list[tuple[str, Mapping[str, Mapping[str, Key]]]] = []
    for name, section in sections_of_file().items():
        same = next((f"`{header}`" for header, kinds in seen if kinds == section.kinds), "")
        table = [f"The keys of {same}."] if same else _table(section.kinds, section.tag)
        parts += ["", f"### `{section.header(name)}`", "", *table]
        seen.append((section.header(name), section.kinds))
    return "\n".join(parts)


def updated(text: str) -> str:
    """The document with the tables between its marks generated again. Raises ``ValueError`` if it has no marks."""
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"the document needs the marks {BEGIN} and {END}")
    return f"{before}{BEGIN}\n\n{tables()}\n\n{END}{after}"


def _table(kinds: Mapping[str, Mapping[str, Key]], tag: str) -> Iterable[str]:
    """Rows of a Markdown table; a key that several kinds share with the same meaning has one row."""
    rows: dict[Key, list[str]] = {}
    for kind, keys in kinds.items():
        for key in keys.values():
            for one in (key, *(replace(part, name=f"{key.name}.{part.name}") for part in key.parts)):
                rows.setdefault(one, []).append(kind)
    heads = ["key", *([f"for `{tag}`"] if tag else []), "unit", "default", "allowed values", "meaning"]
    yield _row(heads)
    yield _row(["---"] * len(heads))
    for key, owners in sorted(rows.items(), key=lambda row: row[0].name != tag):
        whose = "all" if len(owners) == len(kinds) else ", ".join(owners)
        default = f"`{key.default}`" if key.default else "required" if key.required else ""
        yield _row([f"`{key.name}`", *([whose] if tag else []), key.unit, default, key.expected, key.meaning])


def _row(cells: Iterable[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


if __name__ == "__main__":
    file = Path(sys.argv[1])
    file.write_text(updated(file.read_text(encoding="utf-8")), encoding="utf-8")
