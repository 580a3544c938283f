"""How well the machine kept up with the run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from launcher.report.cells import number
from launcher.report.folder import Run
from launcher.report.style import Figures

FIGURES: Final[Figures] = {}
Line = tuple[str, str, bool]
"""Name, value, and whether the value is bad."""


def contents(run: Run) -> dict[str, Any]:
    """See ``Part``."""
    return {"lines": lines(run)}


def lines(run: Run) -> list[Line]:
    """Time, memory, clocks, and what should be 0."""
    m = run.metrics
    late, lost, dropped = m["timing"]["host_late"], m["frames"]["host_lost"], m["recorder"]["dropped"]
    found = [
        ("wall time", number(m["wall_s"], "s"), False),
        ("processor time", number(m["cpu_s"], "s"), False),
        ("events too late to be handled in order (host late)", number(late), bool(late)),
        ("frames lost by the machine", number(lost), bool(lost)),
        ("frames the recorder missed", number(dropped), bool(dropped)),
    ]
    if m["driver"] == "processes":
        found += _processes(m)
    clock = m["clock_error_ms"]
    if clock["rms"] is not None:
        found.append(("clock error, rms / largest", f"{number(clock['rms'])} / {number(clock['max'], 'ms')}", False))
    return found


def _processes(m: Mapping[str, Any]) -> list[Line]:
    """The lines that only a run over processes has."""
    host, timing = m["host_latency_ms"], m["timing"]
    slip, lag, unsettled, foreign = (timing[key] for key in ("slip_ms", "lag_ms", "unsettled", "foreign_corrections"))
    lines = [
        ("processes", number(m["processes"]["started"]), False),
        ("all ready after", number(m["processes"]["ready_s"], "s"), False),
        ("memory of a node", number(m["processes"]["pss_mb_per_node"], "MB"), False),
        (
            "delivery time of a frame in this machine, median / 99 %",
            f"{number(host['p50'])} / {number(host['p99'], 'ms')}",
            False,
        ),
        ("events handled late by, median / 99 %", f"{number(slip['p50'])} / {number(slip['p99'], 'ms')}", False),
        ("events put back in order", number(timing["inversions"]), False),
        ("frames taken back or replaced", number(timing["retractions"]), False),
        (
            "corrections came late by, median / 99 % / most",
            f"{number(lag['p50'])} / {number(lag['p99'])} / {number(lag['max'], 'ms')}",
            False,
        ),
        ("processes not settled at the end", number(unsettled), bool(unsettled)),
    ]
    if missed := m["processes"]["unwritten"]:
        lines.append(("writes that a real device at a port missed", number(missed), True))
    if foreign:
        lines.append(("frames to foreign devices taken back or replaced", number(foreign), True))
    return lines
