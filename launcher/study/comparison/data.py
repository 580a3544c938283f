"""A comparison as data: JSON and CSV, whose keys are those of metrics.json and of the scenarios."""

from __future__ import annotations

import csv
import io
import json
from typing import Any, Final

from launcher.record.figures.measures import RunFigures
from launcher.record.journal import METRICS
from launcher.study.comparison.exact import Exactness
from launcher.study.comparison.remarks import remarks
from launcher.study.comparison.rows import setting
from launcher.study.comparison.runs import Compared

_PAIRS: Final = dict.fromkeys(("nees_band", "nees_position_band"), ("low", "high"))
"""Figures of two numbers, and the ends of their columns' names."""


def as_json(compared: Compared, exact: Exactness | None) -> str:
    """All figures of each run, and what differs between the scenarios; null where a scenario has no such key."""
    runs = zip(compared.names, compared.folders, compared.metrics, strict=True)
    whole = {
        "runs": [{"run": name, "path": str(folder), "metrics": metrics} for name, folder, metrics in runs],
        "settings": {key: dict(zip(compared.names, values, strict=True)) for key, values in compared.settings.items()},
        "remarks": remarks(compared),
        "exact": None if exact is None else exact.plain(),
    }
    return json.dumps(whole, indent=2, default=str)


def as_csv(compared: Compared) -> str:
    """A row for each run and tracker: the settings that differ, then its figures; empty where there is none."""
    rows = []
    for place, (name, folder) in enumerate(zip(compared.names, compared.folders, strict=True)):
        given = {key: _cell(values[place]) for key, values in compared.settings.items() if key != "seed"}
        for row in RunFigures.of(compared.metrics[place], str(folder / METRICS)).rows():
            rows.append({"run": name, "path": str(folder), **given, **_cells(row)})
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]) if rows else ["run", "path"], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _cells(row: dict[str, Any]) -> dict[str, Any]:
    """The figures with a column for each number."""
    found: dict[str, Any] = {}
    for key, value in row.items():
        if ends := _PAIRS.get(key):
            found |= {f"{key}.{end}": one for end, one in zip(ends, value or (None,) * len(ends), strict=True)}
        else:
            found[key] = _cell(value)
    return found


def _cell(value: Any) -> Any:
    """A cell of the CSV: truth values and lists as in JSON."""
    return setting(value) if isinstance(value, bool | list) else value
