"""``python -m trackfield.wire [VECTORS.json]`` prints the tables of docs/wire.md."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from trackfield.wire.tables import kinds_table, vectors_tables

print(kinds_table())
for name in sys.argv[1:]:
    print("\n" + vectors_tables(json.loads(Path(name).read_text())))
