"""The energy spent from batteries, on what, and how long the batteries last."""

from __future__ import annotations

from typing import Any, Final

from launcher.record.words import joules, span
from launcher.records import BATTERY, SENSES
from launcher.report.cells import Bar, Table, percent
from launcher.report.folder import Run
from launcher.report.style import Figures
from trackfield.link.energy import CAUSES

FIGURES: Final[Figures] = {}
FEW: Final = 4
"""So many processes without sensors are named."""
_SPENT: Final = dict(zip(CAUSES, ("sending", "receiving", "listening", "sleeping", "sensing"), strict=True))
_COLOURS: Final = dict(zip(CAUSES, ("#d55e00", "#0072b2", "#e69f00", "#a9b4c2", "#009e73"), strict=True))


def contents(run: Run) -> dict[str, Any]:
    """See ``Part``."""
    return {
        "total": total(run),
        "spent": spent(run),
        "accountings": accountings(run),
        "lifetimes": lifetimes(run),
    }


def total(run: Run) -> str:
    """The energy used, in a sentence; empty if none was."""
    used, most = (run.metrics["energy_j"][key] for key in ("total", "max_node"))
    if not used:
        return ""
    return f"The {_who(run)} used {joules(used)} in all; the one that used most, {joules(most)}."


def _who(run: Run) -> str:
    """Those on batteries."""
    others = [place.id for place in run.tagged(BATTERY) if SENSES not in place.tags]
    if not others:
        return "sensor nodes"
    if others == list(run.field.fusing) and len(others) == 1:
        return "sensor nodes and the centre"
    return f"sensor nodes, {', '.join(others)}" if len(others) <= FEW else f"sensor nodes and {len(others)} others"


def spent(run: Run) -> list[Bar]:
    """The energy spent, by cause."""
    by = {cause: used for cause, used in run.metrics["energy_j"]["by"].items() if used}
    whole = sum(by.values())
    return [
        Bar(_SPENT[cause], f"{joules(used)} ({percent(used / whole)})", used / whole, _COLOURS[cause])
        for cause, used in by.items()
    ]


def accountings(run: Run) -> Table:
    """The total, counted in other ways and on other devices."""
    by = run.metrics["energy_j"]["by_accounting"]
    rows = [[name.replace("_", " "), joules(used)] for name, used in by.items() if used is not None]
    return Table(["accounting or device", "energy"], rows)


def lifetimes(run: Run) -> list[tuple[str, str]]:
    """How long batteries and coverage last, from the start of the run."""
    lifetime = run.metrics["lifetime_s"]
    names = {"first_death": "first battery empty", "half_dead": "half of them empty", "coverage_lost": "coverage lost"}
    beyond = " (at the rate of this run)"
    return [
        (text, f"after {span(t_s)}{beyond if t_s > run.origin_s + run.end_s else ''}")
        for key, text in names.items()
        if (t_s := lifetime[key]) is not None
    ]
