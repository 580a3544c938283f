"""What became of the frames: over time, by cause, by kind of message."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from launcher.report import style
from launcher.report.cells import NOTHING, Bar, Table, number, percent
from launcher.report.folder import Run

MOST_BARS: Final = 80
FATES: Final = {
    "delivered": "reached its receiver in time",
    "late": "came after the deadline of its step",
    "ignored": "not used by the receiver: repeated, unexpected, malformed or impossible",
    "radio": "lost on the link",
    "partition": "sender and receiver were cut off from each other",
    "in_flight": "still under way at the end of the run",
    "asleep": "the receiver's radio was off",
    "frozen": "the receiver was frozen by a planned fault",
    "dead": "the receiver was dead",
    "overflow": "never sent: the queue of the sender's radio was full",
    "container": "the container of the sender or the receiver was stopped or cut off, as planned",
    "host_lost": "lost by the machine itself",
    "host_late": "came too late on this machine to be handled in order",
}


def contents(run: Run) -> dict[str, Any]:
    """See ``Part``."""
    return {"fates": fates(run), "kinds": kinds(run)}


def fates(run: Run) -> list[Bar]:
    """What became of the frames; causes without any are left out."""
    frames = run.metrics["frames"]
    arrived = frames["late"] + int(run.frames.where("outcome", "ignored").sum())
    counts = {
        "delivered": frames["delivered"] - arrived,
        "late": frames["late"],
        "ignored": arrived - frames["late"],
        **frames["lost"],
        "host_lost": frames["host_lost"],
        "host_late": frames["host_late"],
    }
    total = max(frames["expected"], 1)
    return [
        Bar(
            name.replace("_", " "),
            f"{n:,} ({percent(n / total)})",
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
        expected, arrived, late = counted.get(kind, (0, 0, 0))
        share = f"{arrived:,} ({percent(arrived / expected)})" if expected else NOTHING
        rows.append([kind, number(m["sent"]), number(expected), share, number(late), number(m["payload_bytes_max"])])
    return Table(["kind", "sent", "expected at receivers", "arrived", "of them late", "longest payload [bytes]"], rows)


def losses(run: Run) -> Figure | None:
    """Frames by when they were sent and what became of them, stacked; from the first frame on if that is earlier."""
    if not len(run.frames):
        return None
    figure, (axes,) = style.blank(2.9)
    step_s = run.site.step_ns / 1e9
    early_s = max(-float(run.frames.sent_s.min()), 0.0)
    each = step_s * max(round((early_s + run.end_s) / step_s / MOST_BARS), 1)
    edges = np.arange(-np.ceil(early_s / each) * each, run.end_s + each, each)
    bottom = np.zeros(len(edges) - 1)
    for outcome, colour in style.OUTCOMES.items():
        counts, _ = np.histogram(run.frames.sent_s[run.frames.where("outcome", outcome) & run.frames.on_air], edges)
        if counts.any():
            label = outcome if outcome in ("delivered", "late", "ignored") else f"lost: {outcome.replace('_', ' ')}"
            axes.bar(edges[:-1], counts, each * 0.92, bottom, align="edge", color=colour, label=label, lw=0)
            bottom += counts
    axes.set_ylabel(f"frames in {each:g} s")
    style.counts(axes)
    style.over_time(axes, run)
    axes.set_xlim(left=edges[0])
    style.legend(axes, columns=5)
    return figure


FIGURES: Final[style.Figures] = {"losses": losses}
