"""Masters and slaves: who led when, which slaves had which masters, and with how many reports they tracked."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from launcher.record.words import joules, span
from launcher.records import MASTER, SLAVE
from launcher.report import style
from launcher.report.folder import Run
from launcher.report.leading import hears, peers, turn_lines, who_led
from launcher.report.led import read_led
from launcher.report.parts.field import HALO, framed, scaled
from launcher.report.parts.machine import Line

COLOURS: Final = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#8c6d4f", "#7a68a6")
"""Those of masters, again and again."""
NAMED: Final = 100
"""Of more masters the names are left out on the map."""


def contents(run: Run) -> dict[str, Any]:
    """See ``Part``."""
    return {"lines": lines(run) if shown(run) else []}


def shown(run: Run) -> bool:
    """Whether there is anything to show; of nodes of which any may lead, the parts ``heads`` and ``passes`` do."""
    led = run.metrics["leaders"]["per_step_mean"] is not None and not peers(run) and not hears(run)
    return bool(run.metrics["clusters"]["members"]) or led


def lines(run: Run) -> list[Line]:
    """The figures of metrics.json."""
    leaders, clusters, age = (run.metrics[key] for key in ("leaders", "clusters", "age_of_information_s"))
    found = turn_lines(leaders) if leaders["per_step_mean"] is not None else []
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


def leaders(run: Run) -> Figure | None:
    """Who led when; nodes of which any may lead are in the part ``heads``."""
    return None if peers(run) else who_led(run, read_led(run))


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
