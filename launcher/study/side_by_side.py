"""Runs side by side: in what they differ, and what came of it."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from rich.table import Table
from rich.text import Text

from launcher.record.verdict import told

Cell = float | int | str | None
NOTHING: Final = "-"
LONGEST: Final = 40
"""Characters of a scenario's value that are shown."""


@dataclass(frozen=True)
class Row:
    """A figure of each run; ``least`` says that less of it is better."""

    name: str
    cells: tuple[Cell, ...]
    least: bool = False

    @property
    def best(self) -> Cell:
        """The value that is better than another of the row; None if there is no such thing."""
        figures = [cell for cell in self.cells if isinstance(cell, int | float)]
        return min(figures) if self.least and len(set(figures)) > 1 else None


def side_by_side(runs: Sequence[Path]) -> Table:
    """A table of what people compare, a column per run; the best figure of a row stands out."""
    table = Table()
    table.add_column("")
    for run in runs:
        table.add_column(run.name, justify="right", overflow="fold")
    groups = [list(_settings(runs)), *_figures([json.loads((run / "metrics.json").read_text()) for run in runs])]
    for group in groups:
        for row in group:
            table.add_row(row.name, *(_text(cell, best=cell is not None and cell == row.best) for cell in row.cells))
        if group:
            table.add_section()
    return table


def _text(cell: Cell, *, best: bool) -> Text:
    said = NOTHING if cell is None else f"{cell:.3f}" if isinstance(cell, float) else str(cell)
    return Text(said, style="bold green" if best else "")


# --- in what they differ ----------------------------------------------------------------------------------------------


def _settings(runs: Sequence[Path]) -> Iterator[Row]:
    """Each key of the scenarios that is not the same in all runs."""
    read = [dict(_flat(tomllib.loads((run / "scenario.toml").read_text(encoding="utf-8")))) for run in runs]
    for key in dict.fromkeys(key for scenario in read for key in scenario):
        values = tuple(scenario.get(key) for scenario in read)
        if len(set(values)) > 1:
            yield Row(key, tuple(map(_short, values)))


def _flat(values: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, str]]:
    """(key path, value in words) of each; a list is one value."""
    for key, value in values.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{before}{key}.")
        else:
            yield f"{before}{key}", value if isinstance(value, str) else json.dumps(value)


def _short(value: str | None) -> str | None:
    return value if value is None or len(value) <= LONGEST else f"{value[: LONGEST - 4]} ..."


# --- what came of it --------------------------------------------------------------------------------------------------


def _figures(metrics: Sequence[Mapping[str, Any]]) -> Iterator[list[Row]]:
    """The rows in groups; what is nothing in all runs is left out, but for what everybody looks for."""

    def row(name: str, *path: str, least: bool = False) -> Row:
        return Row(name, tuple(_at(m, path) for m in metrics), least)

    drivers = row("driver", "driver")
    yield [drivers] if len(set(drivers.cells)) > 1 else []
    for name in dict.fromkeys(name for m in metrics for name in m["trackers"]):
        yield list(_tracker(name, metrics))
    yield _telling(
        row("bound of these reports [m]", "bound", "trajectory"),
        row("bound of this field [m]", "bound", "position"),
    )
    frames = [row(f"frames {key}", "frames", key) for key in ("sent", "expected", "delivered", "late")]
    losses = tuple(sum(m["frames"]["lost"].values()) for m in metrics)
    causes = dict.fromkeys(cause for m in metrics for cause in m["frames"]["lost"])
    yield [
        *frames,
        Row("frames lost", losses, least=True),
        *_telling(*(row(f"  {cause.replace('_', ' ')}", "frames", "lost", cause) for cause in causes)),
        *_telling(row("frames lost by the machine", "frames", "host_lost")),
    ]
    yield _telling(
        row("payload [bytes]", "bytes", "payload", least=True),
        row("on the air [bytes]", "bytes", "on_air", least=True),
        row("on the link, 95 % [ms]", "latency_ms", "link", "p95", least=True),
        row("step to track, 95 % [ms]", "latency_ms", "to_track", "p95", least=True),
        row("clock error, rms [ms]", "clock_error_ms", "rms", least=True),
        row("energy [J]", "energy_j", "total", least=True),
        row("first battery empty [s]", "lifetime_s", "first_death"),
    )
    yield [row("host late", "timing", "host_late")]


def _tracker(name: str, metrics: Sequence[Mapping[str, Any]]) -> Iterator[Row]:
    """Of one tracker: how far off it was, against the bound of its run, and whether its covariances were right."""
    found = [m["trackers"].get(name) for m in metrics]
    errors = tuple(t and t["rmse"]["position"] for t in found)
    bounds = [_at(m, ("bound", "trajectory")) for m in metrics]
    ratios = tuple(e / b if e is not None and b else None for e, b in zip(errors, bounds, strict=True))
    yield Row(f"{name} RMSE [m]", errors, least=True)
    yield from _telling(Row(f"{name} RMSE / bound", ratios, least=True))
    yield Row(f"{name} median error [m]", tuple(t and t["median_error"] for t in found), least=True)
    yield from _telling(Row(f"{name} NEES", tuple(t and t["nees"] for t in found)))
    bands = [t and t.get("nees_band") for t in found]
    yield from _telling(Row(f"{name} NEES, 95 % band", tuple(b and f"{b[0]:.3f} to {b[1]:.3f}" for b in bands)))
    yield Row(f"{name} verdict", tuple(None if t is None else told(t) for t in found))


def _telling(*rows: Row) -> list[Row]:
    return [row for row in rows if any(row.cells)]


def _at(metrics: Mapping[str, Any], path: Sequence[str]) -> Any:
    """The figure at this path; None where the run has none."""
    found: Any = metrics
    for key in path:
        found = (found or {}).get(key)
    return found
