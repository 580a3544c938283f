"""Who led when, drawn; and the figures of those who take turns at leading."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from launcher.record.figures.terms import ELECTION, HAND_OVER, TAKE_OVER
from launcher.records import PEER, Passing
from launcher.report import style
from launcher.report.cells import number
from launcher.report.folder import Run
from launcher.report.led import Led, seconds

MOST_ROWS: Final = 24
"""Of more leaders the names are left out."""
LOOKS: Final[Mapping[str, Mapping[str, Any]]] = {
    "hand-over": {"marker": "o", "color": "white", "mec": style.INK, "ms": 4.0},
    "take-over": {"marker": "^", "color": "#e69f00", "mec": style.INK, "ms": 6.0},
    "false take-over": {"marker": "^", "color": style.DEAD, "mec": style.DEAD, "ms": 6.0},
    "election": {"marker": "D", "color": "#0072b2", "mec": style.INK, "ms": 5.0},
    "given up": {"marker": "|", "color": style.INK, "mec": style.INK, "mew": 2.0, "ms": 9.0},
    "hand-over lost": {"marker": "x", "color": style.DEAD, "mec": style.DEAD, "ms": 5.0},
}
"""How a term begins, or does not, or ends."""


def peers(run: Run) -> bool:
    """Whether any node may lead."""
    return any(place.role == PEER for place in run.places)


def hears(run: Run) -> bool:
    """Whether clusters hear targets pass; their heads have no terms to hand over."""
    return isinstance(run.field.schedule, Passing)


def turn_lines(leaders: Mapping[str, Any]) -> list[tuple[str, str, bool]]:
    """The figures of those who took turns, from ``leaders`` of metrics.json: name, value, and whether that is bad."""
    return [
        ("hand-overs", f"{leaders['handovers']:,}, and {leaders['lost_handovers']:,} lost", False),
        ("take-overs", f"{leaders['take_overs']:,}, {leaders['false_take_overs']:,} of them false", False),
        ("leaders in a step, mean and most", f"{leaders['per_step_mean']:.3g}, {leaders['per_step_max']}", False),
        ("steps with two leaders", f"{leaders['two_leader_steps']:,}", False),
        ("reports that the leader used in a step, mean", number(leaders["reports_used"]), False),
        ("sensors that it had asked to measure, mean", number(leaders["reports_asked"]), False),
    ]


def who_led(run: Run, led: Led) -> Figure | None:
    """Who led when, and how each term began; the reports of each step, and for how many the leader had asked."""
    if not led.turns:
        return None
    ids = list(dict.fromkeys([*(turn.leader for turn in led.turns), *(lost.src for lost in led.lost)]))
    high = float(np.clip(0.19 * len(ids), 0.7, 4.0))
    figure, (strip, reports) = style.blank(high + 2.1, 2, ratios=[high, 1.3])
    style.over_time(strip, run)
    strip.set_xlabel("")
    _terms(strip, run, led, ids)
    _begun(strip, run, led, ids)
    strip.set_ylim(len(ids) - 0.4, -0.6)
    strip.set_yticks(range(len(ids)) if len(ids) <= MOST_ROWS else [], ids if len(ids) <= MOST_ROWS else [])
    strip.tick_params(axis="y", labelsize=7.5)
    strip.set_ylabel("who leads")
    style.legend(strip)
    style.over_time(reports, run, named=False)
    _reports(reports, run, led)
    return figure


def _terms(axes: Axes, run: Run, led: Led, ids: Sequence[str]) -> None:
    """A bar for each term, from when it was first seen to its last point."""
    for turn in led.turns:
        begun_ns = turn.begun_ns
        until_ns = max((led.until_ns or {}).get((turn.number, turn.leader), begun_ns), begun_ns)
        from_s, until_s = seconds(run, begun_ns), seconds(run, until_ns)
        axes.barh(ids.index(turn.leader), max(until_s - from_s, 0.2 * run.step_s), 0.62, from_s, color="#3d9a62")


def _begun(axes: Axes, run: Run, led: Led, ids: Sequence[str]) -> None:
    """How each term began: a mark where it did, and a line from the one before."""
    marks: dict[str, list[tuple[float, int]]] = {name: [] for name in LOOKS}
    before: str | None = None
    for turn in led.turns:
        row, t_s = ids.index(turn.leader), seconds(run, turn.begun_ns)
        if turn.how in (HAND_OVER, TAKE_OVER, ELECTION):
            marks["false take-over" if turn.false and turn.how == TAKE_OVER else turn.how].append((t_s, row))
            if before is not None and before != turn.leader:
                axes.plot([t_s, t_s], [ids.index(before), row], color=style.SOFT, lw=0.8, zorder=1.5)
        before = turn.leader
    marks["hand-over lost"] = [(seconds(run, lost.sent_ns), ids.index(lost.src)) for lost in led.lost]
    marks["given up"] = [(seconds(run, t_ns), ids.index(id)) for (_, id), t_ns in (led.over or {}).items() if id in ids]
    for name, places in marks.items():
        if places:
            axes.plot(*np.array(places, float).T, ls="", label=name, zorder=4, **LOOKS[name])


def _reports(axes: Axes, run: Run, led: Led) -> None:
    """The reports of each step."""
    curves: list[tuple[Mapping[int, int] | None, dict[str, Any]]] = [
        (led.asked, {"color": style.SOFT, "label": "asked for", "lw": 1.2, "ls": "--"}),
        (led.used, {"color": "#0072b2", "label": "used", "lw": 1.4}),
    ]
    for counts, look in curves:
        if counts is None:
            continue
        steps = np.arange(1, run.last_step + 1)
        values = np.array([counts.get(int(step), np.nan) for step in steps], float)
        axes.plot(steps * run.step_s, style.rolling(values, run.window), drawstyle="steps-mid", **look)
    axes.set_ylim(bottom=0)
    axes.set_ylabel("reports")
    style.counts(axes)
    style.legend(axes)
