"""What a report says in words and tables, from the figures of a run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from launcher.record.words import span
from launcher.report import style
from launcher.report.folder import Run
from trackfield.link.energy import CAUSES

NOTHING: Final = "–"
MOST_IDS: Final = 6
MOST_EVENTS: Final = 60
FATES: Final = {
    "delivered": "reached its hearer in time",
    "late": "came after the deadline of its step",
    "ignored": "of no use to the hearer: repeated, unexpected, malformed",
    "radio": "lost on the link",
    "partition": "sender and hearer were cut off from each other",
    "in_flight": "still on its way at the end of the run",
    "asleep": "the hearer's receiver was off",
    "frozen": "the hearer was frozen by a planned fault",
    "dead": "the hearer was dead",
    "overflow": "never sent, the queue of the sender's radio was full",
    "host_lost": "lost by the machine itself",
}
_SPENT: Final = dict(zip(CAUSES, ("sending", "receiving", "listening", "sleeping", "sensing"), strict=True))


@dataclass(frozen=True)
class Table:
    """Rows under a head; the first column is text, the others are figures."""

    head: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True)
class Bar:
    """A line of a bar chart: ``share`` of the longest (0 to 1), its colour, and what it means."""

    label: str
    value: str
    share: float
    colour: str
    meaning: str = ""


@dataclass(frozen=True)
class Verdict:
    """What became of one tracker, in a sentence; ``good`` unless it lost the target or never had it."""

    tracker: str
    colour: str
    state: str
    good: bool
    text: str


def number(value: float | None, unit: str = "") -> str:
    """A figure to three digits or so; a dash for none."""
    if value is None or not np.isfinite(value):
        return NOTHING
    size = abs(value)
    if isinstance(value, int) or size >= 100:
        text = f"{value:,.0f}"
    else:
        text = f"{value:.1f}" if size >= 10 else f"{value:.2f}" if size >= 1 or not size else f"{value:.3g}"
    return f"{text} {unit}".rstrip()


# --- trackers ---------------------------------------------------------------------------------------------------------


def verdicts(run: Run) -> list[Verdict]:
    """One for each tracker."""
    return [_verdict(run, name, m) for name, m in run.metrics["trackers"].items()]


def _verdict(run: Run, name: str, m: dict[str, Any]) -> Verdict:
    colour = style.colour(run, name)
    if not m["steps"]:
        return Verdict(name, colour, "no track", False, "It never had a track of the target.")
    of = sum(int(np.isfinite(track.truth[:, 0]).sum()) for track in run.tracks if track.tracker == name)
    steps = f"all {of} steps" if m["steps"] == of else f"{m['steps']} of {of} steps"
    blind = sum(int(track.coasting.sum()) for track in run.tracks if track.tracker == name)
    steps += f", {blind} of them without a report" if blind else ""
    rmse, bound = m["rmse"]["position"], _bound(run, name)
    error = f"RMSE {number(rmse, 'm')}, median error {number(m['median_error'], 'm')}, over {steps}"
    if bound:
        error += f"; {rmse / bound:.2f} times the bound of {number(bound, 'm')}"
    text = f"{error}. {_consistency(m)}".rstrip()
    return Verdict(name, colour, "lost" if m["lost"] else "followed", not m["lost"], text)


def _consistency(m: dict[str, Any]) -> str:
    """Whether a tracker's covariances told the truth about its errors."""
    nees, band = m["nees"], m.get("nees_band")
    if nees is None:
        return ""
    if not band:
        return f"NEES {number(nees)} (4 if its covariances are right)."
    low, high = band
    fit = "too sure of itself" if nees > high else "more cautious than it need be" if nees < low else "consistent"
    return f"NEES {number(nees)}, 95 % band {number(low)} to {number(high)}: {fit}."


def _bound(run: Run, name: str) -> float | None:
    """What this tracker's error is measured by, m; a smoothed track knows of later reports, so it has none."""
    return run.bound_m if any(np.isfinite(t.bound).any() for t in run.tracks if t.tracker == name) else None


def consistency(run: Run) -> Table:
    """The mean NEES of every tracker beside the band in which it lies if its covariances are right."""
    rows = []
    for name, m in run.metrics["trackers"].items():
        low, high = m.get("nees_band") or (None, None)
        rows.append([name, number(m["nees"]), number(low), number(high)])
    return Table(["tracker", "mean NEES", "95 % band from", "to"], rows)


def trackers(run: Run) -> Table:
    """How far off every tracker was; the bound only where there is one."""
    lines = [_line(_bound(run, name), name, m) for name, m in run.metrics["trackers"].items()]
    head = [column for column in lines[0] if run.bound_m or column != "/ bound"] if lines else []
    return Table(head, [[line[column] for column in head] for line in lines])


def _line(bound_m: float | None, name: str, m: dict[str, Any]) -> dict[str, str]:
    rmse = m["rmse"]
    return {
        "tracker": name,
        "RMSE [m]": number(rmse["position"]),
        "/ bound": number(rmse["position"] / bound_m if bound_m and rmse["position"] is not None else None),
        "east [m]": number(rmse["x"]),
        "north [m]": number(rmse["y"]),
        "median [m]": number(m["median_error"]),
        "velocity [m/s]": number(rmse["velocity"]),
        "steps": number(m["steps"]),
        "lost": "yes" if m["lost"] else "no",
    }


# --- messages ---------------------------------------------------------------------------------------------------------


def fates(run: Run) -> list[Bar]:
    """What became of the frames, each cause that there was."""
    frames = run.metrics["frames"]
    arrived = frames["late"] + int(run.frames.where("outcome", "ignored").sum())
    counts = {
        "delivered": frames["delivered"] - arrived,
        "late": frames["late"],
        "ignored": arrived - frames["late"],
        **frames["lost"],
        "host_lost": frames["host_lost"],
    }
    total = max(frames["expected"], 1)
    return [
        Bar(
            name.replace("_", " "),
            f"{n:,} ({n / total:.1%})",
            n / total,
            style.OUTCOMES.get(name, style.DEAD),
            FATES.get(name, ""),
        )
        for name, n in counts.items()
        if n or name == "delivered"
    ]


def kinds(run: Run) -> Table:
    """Messages by kind: how many were sent, what became of them, and the longest."""
    counted = run.frames.by_kind()
    rows = []
    for kind, m in run.metrics["frames"]["by_kind"].items():
        expected, arrived = counted.get(kind, (0, 0))
        share = f"{arrived:,} ({arrived / expected:.1%})" if expected else NOTHING
        rows.append([kind, number(m["sent"]), number(expected), share, number(m["payload_bytes_max"])])
    return Table(["kind", "sent", "expected at hearers", "arrived", "longest payload [bytes]"], rows)


def latencies(run: Run) -> Table:
    """How long frames, reports and tracks took, emulated."""
    names = {"link": "on the link", "to_filter": "sending of a report to its fusion", "to_track": "step to its track"}
    rows = [
        [text, *(number(run.metrics["latency_ms"][key][q]) for q in ("p50", "p95", "p99", "max"))]
        for key, text in names.items()
    ]
    return Table(["emulated, ms", "median", "95 %", "99 %", "longest"], rows)


# --- energy -----------------------------------------------------------------------------------------------------------


def energy(run: Run) -> list[Bar]:
    """What the sensor nodes spent, by cause."""
    by = {cause: joules for cause, joules in run.metrics["energy_j"]["by"].items() if joules}
    total = sum(by.values())
    colours = dict(zip(CAUSES, ("#d55e00", "#0072b2", "#e69f00", "#a9b4c2", "#009e73"), strict=True))
    return [
        Bar(_SPENT[cause], f"{number(joules, 'J')} ({joules / total:.1%})", joules / total, colours[cause])
        for cause, joules in by.items()
    ]


def accountings(run: Run) -> Table:
    """The total, counted in other ways and on other devices."""
    by = run.metrics["energy_j"]["by_accounting"]
    rows = [[name.replace("_", " "), number(joules)] for name, joules in by.items() if joules is not None]
    return Table(["accounting, or device", "energy [J]"], rows)


def lifetimes(run: Run) -> list[tuple[str, str]]:
    """How long batteries and coverage last."""
    lifetime = run.metrics["lifetime_s"]
    names = {"first_death": "first battery empty", "half_dead": "half of them empty", "coverage_lost": "coverage lost"}
    beyond = " (at the rate of this run)"
    return [
        (text, f"after {span(t_s)}{beyond if t_s > run.end_s else ''}")
        for key, text in names.items()
        if (t_s := lifetime[key]) is not None
    ]


# --- what went wrong --------------------------------------------------------------------------------------------------


def troubles(run: Run) -> Table:
    """Planned faults and what nobody planned, in the order of time, alike ones in a line; then empty batteries."""
    events = [(t_s, "planned", text, id) for t_s, id, text in run.marks]
    processes = run.metrics["processes"]
    events += [(one["t"], "not planned", f"died: {one['why']}", one["id"]) for one in processes["died"] or []]
    for one in processes["stopped"] or []:
        how_long = "and never went on" if one["s"] is None else f"for {one['s']:.1f} s"
        events.append((one["t"], "not planned", f"stood still {how_long}", one["id"]))
    together: dict[tuple[float | None, str, str], list[str]] = {}
    for t_s, sort, text, id in sorted(events, key=lambda event: (event[0] or 0.0, *event[1:])):
        together.setdefault((t_s, sort, text), []).append(id)
    rows = [
        ["before the start" if t_s is None else f"{t_s:.1f} s", text, ids(who), sort]
        for (t_s, sort, text), who in together.items()
    ]
    if len(rows) > MOST_EVENTS:
        rows = [*rows[:MOST_EVENTS], [NOTHING, f"and {len(rows) - MOST_EVENTS} more", "", ""]]
    return Table(["when", "what", "whom", ""], [*rows, *_batteries(run)])


def _batteries(run: Run) -> list[list[str]]:
    """Those that were empty before the end, in one line, as they may be all."""
    empty = sorted((one["t"], one["id"]) for one in run.metrics["lifetime_s"].get("empty") or [])
    if not empty:
        return []
    first, last = empty[0][0], empty[-1][0]
    when = f"{first:.1f} s" if len(empty) == 1 else f"{first:.1f} to {last:.1f} s"
    return [[when, "battery empty", ids(id for _, id in empty), "drained"]]


def ids(names: Iterable[str]) -> str:
    """The first few, and how many there are."""
    known = list(names)
    more = f" and {len(known) - MOST_IDS} more" if len(known) > MOST_IDS else ""
    return ", ".join(known[:MOST_IDS]) + more


# --- the machine ------------------------------------------------------------------------------------------------------


def machine(run: Run) -> list[tuple[str, str, bool]]:
    """How the run went on its machine: what, how much, and whether that is a reason to worry."""
    m = run.metrics
    timing, processes, host = m["timing"], m["processes"], m["host_latency_ms"]
    rows: list[tuple[str, str, bool]] = [
        ("wall time", number(m["wall_s"], "s"), False),
        ("processor time", number(m["cpu_s"], "s"), False),
        ("host late: events out of order for good", number(timing["host_late"]), bool(timing["host_late"])),
        ("frames lost by the machine", number(m["frames"]["host_lost"]), bool(m["frames"]["host_lost"])),
        ("frames the recorder missed", number(m["recorder"]["dropped"]), bool(m["recorder"]["dropped"])),
    ]
    if m["driver"] == "processes":
        rows += [
            ("processes", number(processes["started"]), False),
            ("all ready after", number(processes["ready_s"], "s"), False),
            ("memory of a node", number(processes["pss_mb_per_node"], "MB"), False),
            ("put to callback, median / 99 %", f"{number(host['p50'])} / {number(host['p99'], 'ms')}", False),
            (
                "slip, median / 99 %",
                f"{number(timing['slip_ms']['p50'])} / {number(timing['slip_ms']['p99'], 'ms')}",
                False,
            ),
            ("inversions put right", number(timing["inversions"]), False),
        ]
    clock = m["clock_error_ms"]
    if clock["rms"] is not None:
        rows.append(("clock error, rms / largest", f"{number(clock['rms'])} / {number(clock['max'], 'ms')}", False))
    return rows
