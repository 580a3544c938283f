"""camera.json in a run folder: what the processes of a camera told, in words that docs/metrics.md explains."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from launcher.files import write_whole
from launcher.outside import Outside
from launcher.record.outside.rows import KINDS
from trackfield.models.pointing import Mount


def write_camera(outside: Outside, file: Path) -> None:
    """Write what was told, one row a line, whole or not at all."""
    mount = {name: getattr(outside.mount, name) for name in Mount.__dataclass_fields__}
    parts = [f'  "mount": {json.dumps(mount, allow_nan=False)}']
    for name, kind in KINDS.items():
        rows = ",\n    ".join(_row(kind, row) for row in getattr(outside, name))
        parts.append(f'  "{name}": [\n    {rows}\n  ]' if rows else f'  "{name}": []')
    write_whole(file, "{\n" + ",\n".join(parts) + "\n}\n")


def _row(kind: Any, row: tuple[Any, ...]) -> str:
    return json.dumps(dict(zip(kind._fields, row, strict=True)), allow_nan=False)
