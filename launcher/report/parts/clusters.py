"""Masters and slaves: who led when, which slaves had which masters, and with how many reports they tracked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from launcher.record.figures.terms import HAND_OVER, TAKE_OVER
from launcher.record.words import joules, span
from launcher.records import MASTER, SLAVE
from launcher.report import style
from launcher.report.cells import number
from launcher.report.folder import Run
from launcher.report.led import Led, read_led, seconds
from launcher.report.parts.field import HALO, framed, scaled
from launcher.report.parts.machine import Line

COLOURS: Final = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#8c6d4f", "#7a68a6")
"""Those of masters, again and again."""
MOST_ROWS: Final = 24
"""Of more leaders the names are left out."""
NAMED: Final = 100
"""Of more masters the names are left out on the map."""
LOOKS: Final[Mapping[str, Mapping[str, Any]]] = {
    "hand-over": {"marker": "o", "color": "white", "mec": style.INK, "ms": 4.0},
    "take-over": {"marker": "^", "color": "#e69f00", "mec": style.INK, "ms": 6.0},
    "false take-over": {"marker": "^", "color": style.DEAD, "mec": style.DEAD, "ms": 6.0},
    "hand-over lost": {"marker": "x", "color": style.DEAD, "mec": style.DEAD, "ms": 5.0},
}
"""How a term begins, or does not."""


def contents(run: Run) -> dict[str, Any]:
    """See ``Part``."""
    return {"lines": lines(run) if shown(run) else []}


def shown(run: Run) -> bool:
    """Whether there is anything to show."""
    return bool(run.metrics["clusters"]["members"]) or run.metrics["leaders"]["per_step_mean"] is not None


def lines(run: Run) -> list[Line]:
    """The figures of metrics.json."""
    leaders, clusters, age = (run.metrics[key] for key in ("leaders", "clusters", "age_of_information_s"))
    found: list[Line] = []
    if leaders["per_step_mean"] is not None:
        two = leaders["two_leader_steps"]
        found += [
            ("hand-overs", f"{leaders['handovers']:,}, and {leaders['lost_handovers']:,} lost", False),
            ("take-overs", f"{leaders['take_overs']:,}, {leaders['false_take_overs']:,} of them false", False),
            ("leaders in a step, mean and most", f"{leaders['per_step_mean']:.3g}, {leaders['per_step_max']}", False),
            ("steps with two leaders", f"{two:,}", False),
            ("reports that the leader used in a step, mean", number(leaders["reports_used"]), False),
            ("sensors that it had asked to measure, mean", number(leaders["reports_asked"]), False),
        ]
    if clusters["orphans_first"] is not None:
        sizes = [len(members) for members in clusters["members"].values()] or [0]
        mean, most = float(np.mean(sizes)), max(sizes)
        orphans = f"{clusters['orphans_first']:,} at the first step, {clusters['orphans_last']:,} at the end"
        found += [
            ("slaves of a master at the end, mean and most", f"{mean:.3g}, {most}", False),
            ("slaves without a master", orphans, False),
            ("answers of masters that other slaves overheard", f"{clusters['overheard']:,}", False),
        ]
    if age["mean"] is not None:
        found.append(
            ("how old what the base knew was, mean and 95 %", f"{span(age['mean'])}, {span(age['p95'])}", False)
        )
    roles = {role: used for role, used in run.metrics["energy_j"]["by_role"].items() if used is not None}
    return [*found, *((f"energy of those with the role {role}", joules(used), False) for role, used in roles.items())]


# --- who led ----------------------------------------------------------------------------------------------------------


def leaders(run: Run) -> Figure | None:
    """Who led when, and how each term began; the reports of each step, and for how many the leader had asked."""
    led = read_led(run)
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
        if turn.how in (HAND_OVER, TAKE_OVER):
            marks["false take-over" if turn.false else turn.how].append((t_s, row))
            if before is not None and before != turn.leader:
                axes.plot([t_s, t_s], [ids.index(before), row], color=style.SOFT, lw=0.8, zorder=1.5)
        before = turn.leader
    marks["hand-over lost"] = [(seconds(run, lost.sent_ns), ids.index(lost.src)) for lost in led.lost]
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
        steps = np.arange(1, run.last_step + 1)
        values = np.array([(counts or {}).get(int(step), np.nan) for step in steps], float)
        axes.plot(steps * run.step_s, style.rolling(values, run.window), drawstyle="steps-mid", **look)
    axes.set_ylim(bottom=0)
    axes.set_ylabel("reports")
    style.counts(axes)
    style.legend(axes)


# --- who belonged to whom ---------------------------------------------------------------------------------------------


def clusters(run: Run) -> Figure | None:
    """The masters, and their slaves at the end in their colours."""
    members = run.metrics["clusters"]["members"]
    at = {place.id: (place.x, place.y) for place in run.places if place.role in (MASTER, SLAVE)}
    slaves = [place.id for place in run.places if place.role == SLAVE]
    if not members or not slaves:
        return None
    figure, (axes,) = style.blank(5.2)
    box = framed(np.array(list(at.values())))
    taken, size = set[str](), style.size(len(at))
    for index, (master, own) in enumerate(members.items()):
        mine, colour = [id for id in own if id in at], COLOURS[index % len(COLOURS)]
        if master not in at:
            continue
        taken.update(mine)
        ends = np.array([(at[master], at[id]) for id in mine]).reshape(-1, 2, 2)
        axes.plot(*ends.transpose(2, 1, 0), color=colour, lw=0.7, alpha=0.7, zorder=2)
        axes.plot(*ends[:, 1].T, "o", color=colour, ms=size, mew=0.0, zorder=3)
        axes.plot(*at[master], "s", color=colour, mec=style.INK, mew=0.7, ms=size + 2.5, zorder=4)
        if len(members) <= NAMED:
            axes.annotate(master, at[master], (3, 3), textcoords="offset points", fontsize=6, color=style.INK,
                          zorder=5, path_effects=[HALO])  # fmt: skip
    alone = [at[id] for id in slaves if id not in taken]
    if alone:
        look: dict[str, Any] = {
            "color": "white",
            "mec": style.DEAD,
            "mew": 1.1,
            "ms": size + 0.5,
            "label": "no master, or dead",
        }
        axes.plot(*np.array(alone).T, "o", zorder=3, **look)
        style.legend(axes)
    scaled(axes, box)
    return figure


FIGURES: Final[style.Figures] = {"leaders": leaders, "clusters": clusters}
