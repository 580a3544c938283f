"""Damages to the files of a run, drawn from a seed: torn, of another kind, or with values that no run has."""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from typing import Any, Final

import pyarrow as pa
import pyarrow.parquet as pq

Damage = Callable[[Random, Path, Path], str]
"""Spoils a file, given the same file of another run; says in words what it did."""

ODD: Final[tuple[Any, ...]] = (
    *(None, True, False, -1, 0, 1, 7, 1e308, -1e308, 1e-308, float("nan"), float("inf"), 2**31, 2**63, 2**64, 10**30),
    *("", "x", "nobody", "\x1b[31m\nred", "\ud800", "x" * 100_000, "2026", "/dev/zero", "../..", "NaN", "0"),
    *([], {}, [1, 2], [[]], {"a": 1}, [None], "null"),
)
"""Values that replace one in JSON."""
TOML: Final = (
    '""',
    '"x"',
    "-1",
    "0",
    "true",
    "[]",
    "{}",
    "nan",
    "inf",
    "1e308",
    "1979-05-27",
    "= =",
    '"\\u0000"',
    "[1",
)
"""Values that replace one in TOML; none of them makes a large field or a long run of the scenario."""


# --- any file ---------------------------------------------------------------------------------------------------------


def _missing(_: Random, file: Path, __: Path) -> str:
    file.unlink()
    return "missing"


def _empty(_: Random, file: Path, __: Path) -> str:
    file.write_bytes(b"")
    return "empty"


def _torn(draw: Random, file: Path, _: Path) -> str:
    whole = file.read_bytes()
    kept = draw.choice([draw.randrange(len(whole)), len(whole) - 1, min(draw.randrange(1, 200), len(whole) - 1)])
    file.write_bytes(whole[:kept])
    return f"torn after {kept} of {len(whole)} bytes"


def _flipped(draw: Random, file: Path, _: Path) -> str:
    whole, places = bytearray(file.read_bytes()), []
    for _n in range(draw.randint(1, 8)):
        places.append(draw.randrange(len(whole)))
        whole[places[-1]] ^= 1 << draw.randrange(8)
    file.write_bytes(whole)
    return f"bits flipped in the bytes {places}"


def _noise(draw: Random, file: Path, _: Path) -> str:
    file.write_bytes(draw.randbytes(draw.randrange(1, 5000)))
    return "noise"


def _doubled(_: Random, file: Path, __: Path) -> str:
    file.write_bytes(file.read_bytes() * 2)
    return "twice its contents"


def _folder(_: Random, file: Path, __: Path) -> str:
    file.unlink()
    file.mkdir()
    return "a folder in its place"


def _pipe(_: Random, file: Path, __: Path) -> str:
    file.unlink()
    os.mkfifo(file)
    return "a pipe in its place"


def _endless(_: Random, file: Path, __: Path) -> str:
    file.unlink()
    file.symlink_to("/dev/zero")
    return "a device in its place"


def _circle(_: Random, file: Path, __: Path) -> str:
    file.unlink()
    file.symlink_to(file.name)
    return "a link to itself"


def _other(_: Random, file: Path, other: Path) -> str:
    shutil.copyfile(other, file)
    return "that of another run"


def _neighbour(draw: Random, file: Path, _: Path) -> str:
    name = draw.choice(sorted(one.name for one in file.parent.iterdir() if one.is_file() and one != file))
    shutil.copyfile(file.parent / name, file)
    return f"the contents of {name}"


def _encoded(draw: Random, file: Path, _: Path) -> str:
    text = file.read_bytes().decode("latin-1")
    encoding = draw.choice(["utf-16", "utf-32", "utf-8-sig"])
    file.write_bytes(text.encode(encoding))
    return f"in {encoding}"


ANY: Final[tuple[Damage, ...]] = (
    *(_missing, _empty, _torn, _torn, _torn, _flipped, _flipped, _flipped, _noise, _doubled),
    *(_folder, _pipe, _endless, _circle, _other, _other, _neighbour),
)

# --- JSON -------------------------------------------------------------------------------------------------------------


def _paths(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        yield (*path, key)
        yield from _paths(item, (*path, key))


def _changed_json(draw: Random, file: Path, _: Path) -> str:
    """One value is another, is missing, or is beside one that nobody knows."""
    whole = json.loads(file.read_bytes())
    path = draw.choice(list(_paths(whole)))
    inside = whole
    for key in path[:-1]:
        inside = inside[key]
    how = draw.randrange(10)
    if how == 0:
        del inside[path[-1]]
        said = "is missing"
    elif how == 1 and isinstance(inside, dict):
        inside[draw.choice(["", "nobody", "\x1b[31m", "\ud800", "x" * 10_000])] = inside[path[-1]]
        said = "has a copy under another key"
    else:
        inside[path[-1]] = draw.choice(ODD)
        said = f"is {inside[path[-1]]!r:.40}"
    file.write_text(json.dumps(whole))
    return f"{'.'.join(map(str, path))} {said}"


def _strange_json(draw: Random, file: Path, _: Path) -> str:
    text = file.read_text()
    deep = 100_000
    how, new = draw.choice(
        [
            ("a list", f"[{text}]"),
            ("null", "null"),
            ("a number", "1" * 5000),
            ("deep lists", "[" * deep + "]" * deep),
            ("a key with deep tables", '{"x": ' + '{"a": ' * deep + "1" + "}" * deep + ", " + text.lstrip()[1:]),
            ("every key twice", text.rstrip()[:-1] + "," + text.lstrip()[1:]),
            ("no tables", "{}"),
            ("NaN everywhere", re.sub(r"\d+\.\d+", "NaN", text)),
            ("nulls for numbers", re.sub(r"(?<=: )-?\d+(\.\d+)?", "null", text)),
        ]
    )
    file.write_text(new)
    return how


# --- TOML -------------------------------------------------------------------------------------------------------------


def _changed_toml(draw: Random, file: Path, _: Path) -> str:
    lines = file.read_text().splitlines()
    places = [number for number, line in enumerate(lines) if " = " in line]
    number = draw.choice(places)
    before, how = lines[number], draw.randrange(4)
    key = before.partition(" = ")[0]
    lines[number] = "" if how == 0 else f"{before}\n{before}" if how == 1 else f"{key} = {draw.choice(TOML)}"
    file.write_text("\n".join(lines))
    return f"{before!r} is {lines[number]!r}"


def _strange_toml(draw: Random, file: Path, _: Path) -> str:
    deep = 5000
    how, new = draw.choice([("deep lists", f"x = {'[' * deep}{']' * deep}"), ("nothing known", "a = 1"), ("BOM", "﻿a")])
    file.write_text(new)
    return how


# --- tables -----------------------------------------------------------------------------------------------------------


def _changed_table(draw: Random, file: Path, _: Path) -> str:
    """One column, or one cell of it, is another."""
    table = pq.read_table(file)
    name = draw.choice(table.column_names)
    place, column = table.column_names.index(name), table[name]
    values = column.to_pylist()
    how = draw.randrange(8)
    if how == 0:
        table, said = table.drop_columns(name), "is missing"
    elif how == 1:
        names = [draw.choice(["x", "", name.upper()]) if one == name else one for one in table.column_names]
        table, said = table.rename_columns(names), "has another name"
    elif how == 2:
        table, said = table.append_column(name, column), "is there twice"
    elif how == 3:
        other = draw.choice([pa.string(), pa.float32(), pa.int64(), pa.binary(), pa.list_(pa.int32()), pa.null()])
        table = table.set_column(place, name, pa.nulls(len(values), other))
        said = f"is of nulls of type {other}"
    elif how == 4:
        table = table.set_column(place, name, pa.array([str(value) for value in values]))
        said = "is text"
    else:
        at = draw.randrange(len(values)) if values else None
        odd = _odd_cell(draw, column.type)
        new = [odd if number == at or how == 5 else value for number, value in enumerate(values)]
        table = table.set_column(place, name, pa.array(new, column.type))
        said = f"is {odd!r:.40} {'everywhere' if how == 5 else f'in row {at}'}"
    pq.write_table(table, file)
    return f"{name} {said}"


def _odd_cell(draw: Random, kind: pa.DataType) -> Any:
    if pa.types.is_list(kind):
        inner = _odd_cell(draw, kind.value_type)
        return draw.choice([None, [], [inner], [inner] * 16, [None] * 16])
    if pa.types.is_floating(kind):
        return draw.choice([None, float("nan"), float("inf"), -float("inf"), 1e308, -1e308, 1e-308, -1.0, 0.0, 1e12])
    if pa.types.is_integer(kind):
        most = 2 ** (kind.bit_width - 1)
        return draw.choice([None, -1, 0, 1, 1000, most - 1, -most, most // 2, most // 1000, -most // 1000])
    if pa.types.is_boolean(kind):
        return draw.choice([None, True, False])
    if pa.types.is_binary(kind):
        return draw.choice([None, b"", b"\x00", draw.randbytes(14), b"\x95\x01\x01\x01\x01\x01", b"x" * 300])
    return draw.choice([None, "", "nobody", "fusion", "n000", "\x1b[31m", "x" * 10_000, "delivered", "waiting", "doa"])


def _shaped_table(draw: Random, file: Path, _: Path) -> str:
    table = pq.read_table(file)
    rows = list(range(len(table)))
    draw.shuffle(rows)
    how, new = draw.choice(
        [
            ("no rows", table.slice(0, 0)),
            ("one row", table.slice(0, 1)),
            ("rows in another order", table.take(pa.array(rows, pa.int64()))),
            ("all rows twice", pa.concat_tables([table, table])),
            ("half of the rows", table.slice(0, len(table) // 2)),
            ("no columns", table.select([])),
            ("one more column", table.append_column("more", pa.array(rows, pa.int64()))),
        ]
    )
    pq.write_table(new, file)
    return how


BY_KIND: Final[dict[str, tuple[Damage, ...]]] = {
    ".json": (*ANY, _encoded, _strange_json, _strange_json, *[_changed_json] * 24),
    ".toml": (*ANY, _encoded, _strange_toml, *[_changed_toml] * 10),
    ".parquet": (*ANY, _shaped_table, _shaped_table, _shaped_table, *[_changed_table] * 24),
    ".rrd": ANY,
}
"""The damages to files by their suffixes; what stands there several times is drawn as often."""


def spoil(draw: Random, file: Path, other: Path) -> str:
    """Spoil a file, as the draw has it; what was done, in words."""
    done = draw.choice(BY_KIND[file.suffix])(draw, file, other)
    return f"{file.name}: {done}"
