"""Reads a timeline back from its file."""

from __future__ import annotations

import subprocess
import sys
from collections import defaultdict
from pathlib import Path
from typing import Any

import pyarrow as pa
from rerun.chunk import Chunk, RrdReader

from launcher.timeline import look
from trackfield.role import NS

Values = list[tuple[float | None, Any]]


def read(file: Path, entity: str, component: str) -> Values:
    """(time in s, value) of each row of a component, in order of time; time None: static."""
    found: list[tuple[float | None, int, Any]] = []
    for chunk in RrdReader(file).stream().filter(content=entity).to_chunks():
        batch = chunk.to_record_batch()
        if component not in batch.schema.names:
            continue
        values = batch.column(component).to_pylist()
        times: list[float | None] = [None] * len(values)
        if not chunk.is_static:
            times = [t / NS for t in batch.column(look.TIME).cast(pa.int64()).to_pylist()]
        found += zip(times, range(len(found), len(found) + len(values)), values, strict=True)
    return [(t, value) for t, _, value in sorted(found, key=lambda one: (one[0] or 0.0, one[1]))]


def entities(file: Path) -> set[str]:
    chunks = RrdReader(file).stream().to_chunks()
    return {chunk.entity_path for chunk in chunks if not chunk.entity_path.startswith("/__")}


def views(file: Path) -> dict[str, dict[str, Any]]:
    """What the views are told that the viewer shows, by their names: component -> values.

    Of several blueprints the viewer goes by the one that was written last.
    """
    reader = RrdReader(file)
    stores = [reader.stream(store=store).to_chunks() for store in reader.blueprints()]
    found: defaultdict[str, dict[str, Any]] = defaultdict(dict)
    for chunk in max(stores, key=lambda chunks: max(map(_written, chunks))):
        if chunk.entity_path.startswith("/view/"):
            batch = chunk.to_record_batch()
            parts = {name: batch.column(name).to_pylist()[-1] for name in batch.schema.names if ":" in name}
            if "/overrides/" not in chunk.entity_path:
                found[chunk.entity_path.split("/")[2]] |= parts
    return {parts["ViewBlueprint:display_name"][0]: parts for parts in found.values()}


def _written(chunk: Chunk) -> bytes:
    """The number of the last row of a chunk; rows are numbered by when they were written."""
    return max(chunk.to_record_batch().column("rerun.controls.RowId").to_pylist())  # type: ignore[no-any-return]


def verify(file: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "rerun", "rrd", "verify", str(file)]
    return subprocess.run(command, env={"CI": "1"}, capture_output=True, text=True, check=False)
