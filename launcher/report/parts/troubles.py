"""What went wrong: planned faults, unplanned failures, and empty batteries."""

from __future__ import annotations

from typing import Any, Final

from launcher.report.cells import NOTHING, Table, ids
from launcher.report.folder import Run
from launcher.report.style import Figures

FIGURES: Final[Figures] = {}
MOST_EVENTS: Final = 60


def contents(run: Run) -> dict[str, Any]:
    """See ``Part``."""
    return {"table": troubles(run)}


def troubles(run: Run) -> Table:
    """Planned faults and unplanned failures, in the order of time, equal ones in one line; then empty batteries."""
    events = [(t_s, "planned", text, id) for t_s, id, text in run.marks]
    processes = run.metrics["processes"]
    events += [(one["t"], "not planned", f"died: {one['why']}", one["id"]) for one in processes["died"] or []]
    for one in processes["stopped"] or []:
        how_long = "and never resumed" if one["s"] is None else f"for {one['s']:.1f} s"
        events.append((one["t"], "not planned", f"was stopped from outside {how_long}", one["id"]))
    together: dict[tuple[float | None, str, str], list[str]] = {}
    for t_s, sort, text, id in sorted(events, key=lambda event: (event[0] or 0.0, *event[1:])):
        together.setdefault((t_s, sort, text), []).append(id)
    rows = [
        ["before the start" if t_s is None else f"{round(t_s, 3):g} s", text, ids(who), sort]
        for (t_s, sort, text), who in together.items()
    ]
    if len(rows) > MOST_EVENTS:
        rows = [*rows[:MOST_EVENTS], [NOTHING, f"and {len(rows) - MOST_EVENTS} more", "", ""]]
    return Table(["when", "what", "process", "cause"], [*rows, *_batteries(run)])


def _batteries(run: Run) -> list[list[str]]:
    """Batteries that were empty before the end, in one line, as there may be many."""
    empty = sorted((one["t"], one["id"]) for one in run.metrics["lifetime_s"].get("empty") or [])
    if not empty:
        return []
    first, last = empty[0][0], empty[-1][0]
    when = f"{first:.1f} s" if len(empty) == 1 else f"{first:.1f} to {last:.1f} s"
    return [[when, "battery empty", ids(id for _, id in empty), "used up"]]
